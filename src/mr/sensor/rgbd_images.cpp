#include "mr/sensor/rgbd_images.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>

#include "mr/kit/image_io.h"

namespace mr::sensor {
namespace {

constexpr double kLeastMedian_m = 0.1, kMostMedian_m = 100;  // a median beyond is no room in metres

/// Metres for each of the 65,536 counts; 0 where the count is invalid or out of the sensor's range.
std::vector<float> depth_table(const SensorConfig& sensor, const RgbdImagesSource& files) {
  std::vector<float> table(65536, 0.0f);
  for (std::size_t count = 1; count < table.size(); ++count) {
    const double metres = static_cast<double>(count) * files.depth_unit_m;
    if (metres >= sensor.depth_near_m && metres <= sensor.depth_far_m)
      table[count] = static_cast<float>(metres);
  }
  for (const std::uint16_t count : files.invalid) table[count] = 0;
  return table;
}

/// An Error if a picture has not the size of its camera.
Status check_size(const auto& image, const Camera& camera, const char* which,
                  const std::filesystem::path& file) {
  if (image.width == camera.width && image.height == camera.height) return {};
  const auto size = [](int width, int height) {
    return std::to_string(width) + "x" + std::to_string(height);
  };
  return Error{Error::Cause::invalid,
               file.string() + ": expected " + size(camera.width, camera.height) +
                   " pixels of the " + which + " camera, found " + size(image.width, image.height)};
}

class RgbdImages final : public FrameSource {
 public:
  RgbdImages(const SensorConfig& sensor, SensorId id, double fps)
      : sensor_(sensor),
        files_(*sensor.source.get_if<RgbdImagesSource>()),
        id_(id),
        fps_(fps),
        metres_(depth_table(sensor, files_)) {}

  Result<std::optional<Frame>> next() override {
    const std::size_t items = files_.depth.size();
    if (items == 0 || (index_ >= items && !files_.loop)) return std::optional<Frame>{};
    const std::uint64_t index = index_++;  // a lost frame is not asked for again
    const auto item = static_cast<std::size_t>(index % items);
    auto frame = read_item(item);
    if (!frame) return lost(item, frame.error());
    frame->sensor = id_;
    frame->index = index;
    frame->exposure_start = frame->exposure_end = time_of(index);
    return std::optional<Frame>(std::move(*frame));
  }

  void skip(std::uint64_t frames) override { index_ += frames; }
  bool endless() const override { return files_.loop && !files_.depth.empty(); }

 private:
  Error lost(std::size_t item, Error error) const {
    error.message += " (frame " + std::to_string(item) + " of sensor '" + sensor_.id + "' is lost)";
    return error;
  }

  /// The item's pictures and pose.
  Result<Frame> read_item(std::size_t item) const {
    const auto lost_pose = sensor_.lost_poses.find(item);
    if (lost_pose != sensor_.lost_poses.end()) return lost_pose->second;
    auto depth = read_depth(files_.depth[item]);
    if (!depth) return depth.error();
    Frame frame;
    frame.depth = std::move(*depth);
    if (sensor_.color_camera && !files_.color.empty()) {
      if (item >= files_.color.size())
        return Error{Error::Cause::not_found,
                     files_.depth[item].string() + ": no colour picture belongs to it"};
      auto color = read_color(files_.color[item]);
      if (!color) return color.error();
      frame.color = std::move(*color);
    }
    const auto& poses = sensor_.T_world_depth;
    if (!poses.empty()) frame.T_world_depth = poses[poses.size() == 1 ? 0 : item % poses.size()];
    return frame;
  }

  Result<ImageDepth> read_depth(const std::filesystem::path& file) const {
    const auto counts = kit::read_depth16(file);
    if (!counts) return counts.error();
    const Status fits = check_size(*counts, sensor_.depth_camera, "depth", file);
    if (!fits) return fits.error();
    ImageDepth depth(counts->width, counts->height);
    for (std::size_t i = 0; i < depth.data.size(); ++i) depth.data[i] = metres_[counts->data[i]];
    return depth;
  }

  Result<ImageRgb> read_color(const std::filesystem::path& file) const {
    auto color = kit::read_color(file);
    if (!color) return color.error();
    const Status fits = check_size(*color, *sensor_.color_camera, "colour", file);
    if (!fits) return fits.error();
    return color;
  }

  TimePoint time_of(std::uint64_t index) const {
    const double ns = static_cast<double>(index) * 1e9 / fps_ + sensor_.clock_offset_ms * 1e6;
    return TimePoint(Duration(std::llround(ns)));
  }

  const SensorConfig sensor_;
  const RgbdImagesSource files_;
  const SensorId id_;
  const double fps_;
  const std::vector<float> metres_;  ///< by count
  std::uint64_t index_ = 0;          ///< of the next frame
};

}  // namespace

std::vector<std::filesystem::path> RgbdImagesSource::files() const {
  std::vector<std::filesystem::path> out = color;
  out.insert(out.end(), depth.begin(), depth.end());
  return out;
}

std::optional<std::string> RgbdImagesSource::depth_hint(double median_m) const {
  if (median_m >= kLeastMedian_m && median_m <= kMostMedian_m) return std::nullopt;
  return fmt::format(
      "the median depth is {:.4g} m: check depth_unit_m, now {:g}; with millimetres, 0.001, it "
      "would be {:.4g} m",
      median_m, depth_unit_m, median_m / depth_unit_m * 0.001);
}

std::unique_ptr<FrameSource> open_rgbd_images(const SensorConfig& sensor, SensorId id, double fps) {
  MR_ASSERT(sensor.source.get_if<RgbdImagesSource>() != nullptr);
  MR_ASSERT(fps > 0);
  return std::make_unique<RgbdImages>(sensor, id, fps);
}

}  // namespace mr::sensor
