#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <deque>
#include <string>
#include <vector>

#include "mr/core/frame.h"

namespace mr::node {

/// The offset of a clock in words: "1.00 s behind" or "0.25 s ahead of".
inline std::string clock_offset_text(Duration ahead) {
  const double seconds = std::chrono::duration<double>(std::chrono::abs(ahead)).count();
  char text[32];
  std::snprintf(text, sizeof text, "%.2f s", seconds);
  return std::string(text) + (ahead < Duration{} ? " behind" : " ahead of");
}

/// Estimates the offset of another node's clock from requests and answers, as NTP does: the remote
/// time is assumed to be read half a round trip after the request. The estimate is the median
/// offset of the samples with the shortest round trips. No clock inside.
class ClockOffset {
 public:
  static constexpr std::size_t kKept = 20, kBest = 5;
  /// Smaller offsets are ignored: half a capture period and the error of a busy machine's answers.
  static constexpr Duration kLeastReported = std::chrono::milliseconds(50);
  /// Hysteresis: the estimate changes only if the new one differs by more.
  static constexpr Duration kHysteresis = std::chrono::milliseconds(10);

  void add(TimePoint asked, TimePoint reported, TimePoint answered) {
    const Duration round_trip = answered - asked;
    if (round_trip < Duration::zero()) return;  // our own clock was set back
    samples_.push_back({round_trip, reported - asked - round_trip / 2});
    if (samples_.size() > kKept) samples_.pop_front();
    settle();
  }

  /// How far the other clock is ahead of ours; negative: behind. Zero before the first answer and
  /// for offsets that cannot be distinguished from the round trip's asymmetry.
  Duration offset() const { return offset_; }

 private:
  struct Sample {
    Duration round_trip, offset;
  };

  void settle() {
    std::vector<Sample> best(samples_.begin(), samples_.end());
    std::ranges::sort(best, {}, &Sample::round_trip);
    best.resize(std::min(best.size(), kBest));
    const Duration quickest = best.front().round_trip;
    std::ranges::sort(best, {}, &Sample::offset);
    const Duration found = best[best.size() / 2].offset;
    // The other clock was set: older samples are invalid.
    const Duration newest = samples_.back().offset;
    const Duration doubt = samples_.back().round_trip + kLeastReported;
    if (std::chrono::abs(newest - found) > doubt) samples_ = {samples_.back()};
    const Duration now = samples_.size() == 1 ? newest : found;
    // An offset below half the round trip may come from asymmetric delays.
    const Duration hidden = quickest / 2 + kLeastReported;
    const Duration reported = std::chrono::abs(now) < hidden ? Duration{} : now;
    if (std::chrono::abs(reported - offset_) > kHysteresis) offset_ = reported;
  }

  std::deque<Sample> samples_;
  Duration offset_{};
};

}  // namespace mr::node
