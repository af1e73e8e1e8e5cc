#pragma once

#include <algorithm>
#include <deque>

#include "mr/core/frame.h"

namespace mr::node {

/// Whether a sensor stamps its captures with the time they were made at: the quickest of the last
/// ones was read soon after that. Where they are read long after, or before, the sensor's clock is
/// another than the computer's. No clock inside.
class StampCheck {
 public:
  static constexpr std::size_t kKept = 30, kFewest = 3;                ///< captures
  static constexpr Duration kLatest = std::chrono::milliseconds(400);  ///< mergers wait for 500
  static constexpr Duration kEarliest = std::chrono::milliseconds(-50);
  static constexpr Duration kHold = std::chrono::milliseconds(20);

  /// What to add to the stamps of captures; zero where they are right. `stamped`: the end of the
  /// exposure as the sensor tells it.
  Duration shift(TimePoint stamped, TimePoint read) {
    lags_.push_back(read - stamped);
    if (lags_.size() > kKept) lags_.pop_front();
    if (lags_.size() < kFewest) return shift_;
    const Duration least = *std::min_element(lags_.begin(), lags_.end());
    const bool is_right = least >= kEarliest && least <= kLatest;
    const Duration found = is_right ? Duration{} : least;
    if (std::chrono::abs(found - shift_) > kHold) shift_ = found;
    return shift_;
  }

 private:
  std::deque<Duration> lags_;
  Duration shift_{};
};

}  // namespace mr::node
