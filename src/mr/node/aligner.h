#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "mr/core/frame.h"

namespace mr::node {

/// Brings a merger's inputs to common ticks (multiples of the frame period) by capture time. A tick
/// is ready when every live input has reached it or brought something new since the last one, or
/// `deadline` after the first input did: late and dead inputs never stall the rest, and sensors
/// that are a tick apart do not wait for each other. No clock inside.
class Aligner {
 public:
  /// An input counts as live at a tick when its newest capture is at most this much older; a slow
  /// one, whose captures are up to kSlowest apart, within two and a half times as long as that.
  static constexpr Duration kMaxAge = std::chrono::milliseconds(500);
  static constexpr Duration kSlowest = std::chrono::seconds(3);

  Aligner(std::size_t inputs, Duration period, Duration deadline);

  /// A capture from the future counts as one of now. Where `now` is set back, all starts afresh.
  void arrived(std::size_t input, TimePoint captured_at, TimePoint now);

  /// The tick that can be merged now, if there is one.
  std::optional<TimePoint> ready(TimePoint now) const;

  /// When the tick that waits for late inputs is ready without them.
  std::optional<TimePoint> due() const {
    return pending_ ? std::optional(pending_since_ + deadline_) : std::nullopt;
  }

  /// The inputs whose newest capture belongs to a tick.
  std::vector<std::size_t> live_at(TimePoint tick) const;

  /// The tick was merged; older arrivals do not start it again.
  void merged(TimePoint tick, TimePoint now);

 private:
  struct Input {
    std::optional<TimePoint> newest;  // tick
    Duration interval{};              // since the one before
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
