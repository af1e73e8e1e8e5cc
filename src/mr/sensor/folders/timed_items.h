#pragma once

#include <cstddef>
#include <vector>

#include "mr/sensor/recorded_frames.h"
#include "mr/sensor/rgbd_items.h"

namespace mr::sensor {

/// Reads picture files with a time each; item i is captured at times[i].
class TimedItems final : public RecordingReader {
 public:
  /// `files.times`: one per item, increasing.
  TimedItems(const SensorConfig& sensor, const RgbdImagesSource& files)
      : items_(sensor, files), times_(files.times) {
    MR_ASSERT(times_.size() == items_.size());
  }

  Result<std::optional<Capture>> peek() override;
  Result<Frame> take() override;
  void drop() override { ++next_; }
  Status seek(TimePoint time) override;

 private:
  const RgbdItems items_;
  const std::vector<TimePoint> times_;
  std::size_t next_ = 0;
};

}  // namespace mr::sensor
