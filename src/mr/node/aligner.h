#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "mr/core/frame.h"

namespace mr::node {

/// Aligns a merger's inputs to common ticks (multiples of the frame period) by capture time. A tick
/// is ready when every live input has reached it or has delivered a new capture since the last
/// tick, at the latest `deadline` after the first input reached it: late and dead inputs never
/// stall the others, and sensors that are one tick apart do not wait for each other. No clock
/// inside.
class Aligner {
 public:
  /// An input is live at a tick if its newest capture is at most this much older than the tick; a
  /// slow input, whose captures are up to kSlowest apart, within 2.5 times its capture interval.
  static constexpr Duration kMaxAge = std::chrono::milliseconds(500);
  static constexpr Duration kSlowest = std::chrono::seconds(3);

  Aligner(std::size_t inputs, Duration period, Duration deadline);

  /// An input delivered a capture. One from the future counts as captured now. If `now` is earlier
  /// than before (the clock was set back), the aligner starts afresh.
  void arrived(std::size_t input, TimePoint captured_at, TimePoint now);

  /// The tick that can be merged now, if there is one.
  std::optional<TimePoint> ready(TimePoint now) const;

  /// The time at which the pending tick is ready even without the late inputs.
  std::optional<TimePoint> due() const {
    return pending_ ? std::optional(pending_since_ + deadline_) : std::nullopt;
  }

  /// The inputs that are live at a tick.
  std::vector<std::size_t> live_at(TimePoint tick) const;

  /// The tick was merged; older captures that arrive later do not make it pending again.
  void merged(TimePoint tick, TimePoint now);

 private:
  struct Input {
    std::optional<TimePoint> newest;  // tick
    Duration interval{};              // between the last two captures
    bool is_new = false;              // since the last merge
  };
  TimePoint tick_of(TimePoint captured_at) const;
  static bool is_live(const Input& input, TimePoint tick);

  Duration period_, deadline_;
  std::vector<Input> inputs_;
  std::optional<TimePoint> last_merged_, pending_;
  TimePoint pending_since_{};
};

}  // namespace mr::node
