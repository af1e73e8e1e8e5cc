#include <turbojpeg.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/kit/freed_memory.h"
#include "mr/sensor/azure_kinect/captures.h"
#include "mr/sensor/azure_kinect/source.h"
#include "mr/sensor/timelines.h"
#include "mr/synth/mkv_recording.h"
#include "mr/synth/room.h"
#include "race.h"
#include "report.h"
#include "stage.h"

namespace mr::bench {
namespace {

const std::string kTurboJpeg = "turbojpeg";
constexpr int kFrames = 60;
constexpr double kFps = 30;

/// A recording in the system's folder for such files, gone with the object.
class RecordingFile {
 public:
  RecordingFile()
      : path_(std::filesystem::temp_directory_path() /
              ("mr-bench-" + std::to_string(::getpid()) + ".mkv")) {}
  ~RecordingFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  RecordingFile(const RecordingFile&) = delete;
  RecordingFile& operator=(const RecordingFile&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Two seconds of one sensor of the synthetic rig: depth 640x576, infrared, MJPG 1280x720. Takes
/// threads: for a child.
Status write_recording(const std::filesystem::path& file) {
  synth::RigConfig rig;
  rig.sensors = 1, rig.people = 1, rig.frames = kFrames;
  const auto sensors = synth::rig_sensors(rig);
  const auto source = std::move(
      synth::open_rig(rig, sensors, all_sensors(sensors), kFps, {synth::default_rig_cache(), {}})
          .front());
  synth::MkvDevice device;
  device.depth_camera = sensors[0].depth_camera, device.color_camera = *sensors[0].color_camera;
  device.T_color_depth = sensors[0].T_color_depth;
  device.fps = kFps, device.jpeg_quality = 90;
  auto recording = synth::MkvRecording::create(file, device);
  if (!recording) return recording.error();
  for (int i = 0; i < kFrames; ++i) {
    const auto frame = source->next();
    if (!frame) return frame.error();
    if (const Status written = recording->write(**frame); !written) return written;
  }
  return recording->close();
}

/// Ours: every frame of the recording, as a sensor node reads it.
class ReadMkv final : public Work {
 public:
  explicit ReadMkv(const std::filesystem::path& file) : arena_(1) {
    const auto header = header_of(file);
    const auto cameras = sensor::kinect_cameras(header, file, {});
    MR_ASSERT(cameras.ok());
    sensor_.id = "kinect";
    sensor::KinectMkvSource source;
    source.file = file, source.recorded = {"", *header.first, {}};
    sensor_.source = source;
    sensor_.depth_camera = cameras->depth, sensor_.color_camera = cameras->color;
    sensor_.depth_near_m = 0.3, sensor_.depth_far_m = 6;
    sensor_.T_world_depth = {Pose{}};
  }

  void clear() override {}
  void run(StageClock&) override {
    arena_.run([&] {
      const auto source = sensor::open_kinect_mkv(
          sensor_, {}, sensor::timelines(std::span(&sensor_, 1), kFps).front());
      frames_ = pictures_ = 0;
      while (true) {
        const auto frame = source->next();
        if (frame && !*frame) break;
        if (!frame) continue;
        ++frames_;
        pictures_ += !(*frame)->color.empty();
      }
    });
  }
  Message result() override { return {{"frames", frames_}, {"color_pictures", pictures_}}; }

 private:
  static sensor::KinectHeader header_of(const std::filesystem::path& file) {
    const auto recording = sensor::KinectRecording::open(file);
    MR_ASSERT(recording.ok());
    return recording->header();
  }

  Arena arena_;
  SensorConfig sensor_;
  int frames_ = 0, pictures_ = 0;
};

/// The peer: libjpeg-turbo decodes the same pictures, which lie in memory, into one buffer.
class DecodePictures final : public Work {
 public:
  explicit DecodePictures(const std::filesystem::path& file) : decoder_(tjInitDecompress()) {
    auto recording = sensor::KinectRecording::open(file);
    MR_ASSERT(recording.ok());
    for (auto block = recording->next(); block && *block; block = recording->next())
      if ((*block)->track == sensor::KinectTrack::color)
        pictures_.emplace_back((*block)->bytes.begin(), (*block)->bytes.end());
  }
  ~DecodePictures() override { tjDestroy(decoder_); }

  void clear() override {}
  void run(StageClock&) override {
    decoded_ = 0;
    for (const auto& picture : pictures_) {
      const auto* bytes = reinterpret_cast<const unsigned char*>(picture.data());
      int width = 0, height = 0, sampling = 0, space = 0;
      if (tjDecompressHeader3(decoder_, bytes, picture.size(), &width, &height, &sampling,
                              &space) != 0)
        continue;
      rgb_.resize(std::size_t{3} * width * height);
      decoded_ += tjDecompress2(decoder_, bytes, picture.size(), rgb_.data(), width, 0, height,
                                TJPF_RGB, 0) == 0;
    }
  }
  Message result() override { return {{"color_pictures", decoded_}}; }

 private:
  tjhandle decoder_;
  std::vector<std::vector<std::byte>> pictures_;
  std::vector<unsigned char> rgb_;
  int decoded_ = 0;
};

template <typename Reader>
Contender contender(const std::string& name, const RecordingFile& file) {
  return {name, 1, Message::object(), [&file] {
            kit::keep_freed_memory();  // as `meshreduce` does
            return std::make_unique<Reader>(file.path());
          }};
}

std::vector<CaseInfo> mkv_cases() {
  return {{"synthetic", "60 captures: depth and infrared 640x576, MJPG 1280x720", true, ""}};
}

Result<Report> run_mkv(const Request& request, cli::ProgressBar& bar) {
  if (!request.input.empty())
    return Error{Error::Cause::unsupported, "mkv takes no --input: it writes its own recording"};
  const auto names = wanted_cases(mkv_cases(), request, "mkv has");
  if (!names) return names.error();
  bar.show("writing a recording", 0, 1);
  const RecordingFile file;
  const auto written = apart([&] {
    const Status status = write_recording(file.path());
    return Message{{"error", status ? "" : status.error().message}};
  });
  if (!written) return written.error();
  if (const std::string error = (*written)["error"]; !error.empty())
    return Error{Error::Cause::io, error};
  const std::vector<Contender> contenders{contender<ReadMkv>(kOurs, file),
                                          contender<DecodePictures>(kTurboJpeg, file)};
  const auto outcomes = race(contenders, {.runs = request.runs},
                             [&](std::size_t done, std::size_t of) { bar.show("mkv", done, of); });
  Report report{.stage = "mkv", .columns = {{"pictures", "color_pictures", 0}}};
  report.input["synthetic"] = {{"captures", kFrames},
                               {"bytes", std::filesystem::file_size(file.path())}};
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    Message row = result_row(contenders[i], "synthetic", outcomes[i]);
    if (!outcomes[i].result.is_null()) row.update(outcomes[i].result);
    report.results.push_back(std::move(row));
  }
  return report;
}

}  // namespace

Stage mkv_stage() {
  return {"mkv", "an Azure Kinect recording to frames; peer: libjpeg-turbo on its pictures alone",
          mkv_cases, run_mkv};
}

}  // namespace mr::bench
