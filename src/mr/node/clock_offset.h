#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <deque>
#include <string>
#include <vector>

#include "mr/core/frame.h"

namespace mr::node {

/// "1.00 s behind", "0.25 s ahead of": how a clock that is `ahead` by so much stands to another.
inline std::string said_of_clock(Duration ahead) {
  const double seconds = std::chrono::duration<double>(std::chrono::abs(ahead)).count();
  char text[32];
  std::snprintf(text, sizeof text, "%.2f s", seconds);
  return std::string(text) + (ahead < Duration{} ? " behind" : " ahead of");
}

/// Another node's clock against ours, from questions and answers (as NTP does): half the time that
/// both took together lies between them, so of the last ones the quickest tell best. No clock
/// inside.
class ClockOffset {
 public:
  static constexpr std::size_t kKept = 20, kBest = 5;
  /// What is less is as good as none: half of a capture, and what a busy machine's answers err by.
  static constexpr Duration kWorthTelling = std::chrono::milliseconds(50);
  /// What was found is kept for as long as it is about right.
  static constexpr Duration kHold = std::chrono::milliseconds(10);

  void add(TimePoint asked, TimePoint told, TimePoint answered) {
    const Duration round_trip = answered - asked;
    if (round_trip < Duration::zero()) return;  // our own clock was set
    samples_.push_back({round_trip, told - asked - round_trip / 2});
    if (samples_.size() > kKept) samples_.pop_front();
    settle();
  }

  /// How far the other clock is ahead of ours; behind, where it is negative. Zero where that is not
  /// worth telling, or nobody answered yet.
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
    // A clock that was set: those of before tell nothing any more.
    const Duration newest = samples_.back().offset;
    const Duration doubt = samples_.back().round_trip + kWorthTelling;
    if (std::chrono::abs(newest - found) > doubt) samples_ = {samples_.back()};
    const Duration now = samples_.size() == 1 ? newest : found;
    // What half of the way may hide is no offset.
    const Duration hidden = quickest / 2 + kWorthTelling;
    const Duration told = std::chrono::abs(now) < hidden ? Duration{} : now;
    if (std::chrono::abs(told - offset_) > kHold) offset_ = told;
  }

  std::deque<Sample> samples_;
  Duration offset_{};
};

}  // namespace mr::node
