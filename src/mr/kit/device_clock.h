#pragma once

#include <deque>
#include <optional>

#include "mr/core/frame.h"

namespace mr::kit {

/// Maps the times of a device's own clock to those of this computer. A frame arrives after a
/// latency that is never below some least one and jitters above it; so the smallest difference of
/// arrival and device time over the last seconds (their lower envelope) is the clocks' offset and
/// that least latency, which stays in the result. The offset follows the clocks' drift slowly:
/// jitter does not move the times. No clock inside.
class DeviceClock {
 public:
  static constexpr Duration kWindow = std::chrono::seconds(10);
  /// Jumps of the offset are followed at once within this time, later at kSlew.
  static constexpr Duration kLearning = std::chrono::seconds(2);
  static constexpr double kSlew = 1e-3;  ///< of the offset, seconds a second
  /// Arrivals that are earlier than the offset says by this, or later for kLate, begin anew.
  static constexpr Duration kJump = std::chrono::milliseconds(200);
  static constexpr Duration kLate = std::chrono::seconds(2);

  /// This computer's time of `device`, which is the device's time of a frame that arrived at
  /// `arrived`. A device time before the last one means that the device's clock was reset, and
  /// begins anew.
  TimePoint system_time(Duration device, TimePoint arrived);

 private:
  struct Sample {
    Duration device{}, offset{};
  };
  void begin_anew(const Sample& sample);
  bool has_jumped(const Sample& sample);
  void follow(Duration device);

  std::deque<Sample> least_;  ///< offsets ascend; the first is the least of the window
  std::optional<Duration> late_since_;
  std::optional<Duration> last_;  ///< device time of the newest sample
  Duration began_{};              ///< device time
  Duration offset_{};
};

}  // namespace mr::kit
