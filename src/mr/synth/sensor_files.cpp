#include "mr/synth/sensor_files.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "mr/kit/image_io.h"
#include "mr/synth/depth_png.h"

namespace mr::synth {
namespace {

class PictureFiles final : public SensorFiles {
 public:
  explicit PictureFiles(std::filesystem::path folder) : folder_(std::move(folder)) {}

  Status write(const Frame& frame) override {
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "%06d.png", number_++);
    const ImageDepth& depth = frame.depth;
    std::vector<std::uint16_t> counts(depth.data.size());
    for (std::size_t i = 0; i < counts.size(); ++i)
      counts[i] = static_cast<std::uint16_t>(std::lround(depth.data[i] * 1000));
    const Status ok =
        write_depth_png(folder_ / "depth" / name.data(), depth.width, depth.height, counts);
    return ok ? kit::write_png(folder_ / "color" / name.data(), frame.color) : ok;
  }

 private:
  const std::filesystem::path folder_;
  int number_ = 0;
};

class MkvFile final : public SensorFiles {
 public:
  explicit MkvFile(MkvRecording recording) : recording_(std::move(recording)) {}

  Status write(const Frame& frame) override { return recording_.write(frame); }
  Status close() override { return recording_.close(); }

 private:
  MkvRecording recording_;
};

}  // namespace

Result<std::unique_ptr<SensorFiles>> open_picture_files(const std::filesystem::path& folder) {
  for (const char* kind : {"color", "depth"})
    if (const Status made = make_folder(folder / kind); !made) return made.error();
  return std::unique_ptr<SensorFiles>(std::make_unique<PictureFiles>(folder));
}

Result<std::unique_ptr<SensorFiles>> open_mkv_file(const std::filesystem::path& file,
                                                   const MkvDevice& device) {
  auto recording = MkvRecording::create(file, device);
  if (!recording) return recording.error();
  return std::unique_ptr<SensorFiles>(std::make_unique<MkvFile>(std::move(*recording)));
}

Status make_folder(const std::filesystem::path& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (!failed) return {};
  return Error{Error::Cause::io, "cannot make folder " + folder.string() + ": " + failed.message()};
}

}  // namespace mr::synth
