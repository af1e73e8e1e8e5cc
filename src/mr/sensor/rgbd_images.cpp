#include "mr/sensor/rgbd_images.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>

#include "mr/sensor/folders/timed_items.h"
#include "mr/sensor/recorded_frames.h"
#include "mr/sensor/rgbd_items.h"

namespace mr::sensor {
namespace {

constexpr double kLeastMedian_m = 0.1, kMostMedian_m = 100;  // a median beyond is no room in metres

class RgbdImages final : public FrameSource {
 public:
  RgbdImages(const SensorConfig& sensor, SensorId id, const Timeline& timeline)
      : sensor_(sensor),
        items_(sensor, *sensor.source.get_if<RgbdImagesSource>()),
        id_(id),
        timeline_(timeline),
        loops_(sensor.source.content().loops) {}

  Result<std::optional<Frame>> next() override {
    if (items_.size() == 0 || (index_ >= items_.size() && !loops_)) return std::optional<Frame>{};
    const std::uint64_t index = index_++;  // a lost frame is not asked for again
    const auto item = static_cast<std::size_t>(index % items_.size());
    const auto pose = sensor_.pose_of(item, TimePoint(timeline_.time_of(item)));
    if (!pose) return items_.lost(item, pose.error());
    auto frame = items_.read(item);
    if (!frame) return items_.lost(item, frame.error());
    frame->sensor = id_;
    frame->index = index;
    frame->exposure_start = frame->exposure_end = time_of(index);
    frame->T_world_depth = *pose;
    return std::optional<Frame>(std::move(*frame));
  }

  void skip(std::uint64_t frames) override { index_ += frames; }
  bool endless() const override { return loops_ && items_.size() > 0; }

 private:
  TimePoint time_of(std::uint64_t index) const {
    const double ns =
        static_cast<double>(index) * 1e9 / timeline_.fps + sensor_.clock_offset_ms * 1e6;
    return TimePoint(Duration(std::llround(ns)));
  }

  const SensorConfig sensor_;
  const RgbdItems items_;
  const SensorId id_;
  const Timeline timeline_;
  const bool loops_;
  std::uint64_t index_ = 0;  ///< of the next frame
};

}  // namespace

std::vector<std::filesystem::path> RgbdImagesSource::files() const {
  std::vector<std::filesystem::path> out = color;
  out.insert(out.end(), depth.begin(), depth.end());
  return out;
}

std::optional<SourceClock> RgbdImagesSource::clock() const {
  if (times.empty()) return std::nullopt;
  return SourceClock{"unix", times.front(), times.back()};
}

std::optional<std::string> RgbdImagesSource::depth_hint(double median_m) const {
  if (median_m >= kLeastMedian_m && median_m <= kMostMedian_m) return std::nullopt;
  return fmt::format(
      "the median depth is {:.4g} m: check depth_unit_m, now {:g}; with millimetres, 0.001, it "
      "would be {:.4g} m",
      median_m, depth_unit_m, median_m / depth_unit_m * 0.001);
}

std::unique_ptr<FrameSource> open_rgbd_images(const SensorConfig& sensor, SensorId id,
                                              const Timeline& timeline) {
  const auto* source = sensor.source.get_if<RgbdImagesSource>();
  MR_ASSERT(source != nullptr);
  MR_ASSERT(timeline.fps > 0);
  if (!source->times.empty())
    return std::make_unique<RecordedFrames>(std::make_unique<TimedItems>(sensor, *source), sensor,
                                            id, timeline);
  return std::make_unique<RgbdImages>(sensor, id, timeline);
}

}  // namespace mr::sensor
