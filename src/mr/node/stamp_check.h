#pragma once

#include <algorithm>
#include <deque>

#include "mr/core/frame.h"

namespace mr::node {

/// Checks the timestamps of a sensor's captures against the time at which the computer reads them.
/// The smallest lag of the last captures excludes jitter; if it is too large or negative, the
/// sensor's clock differs from the computer's, and the stamps are shifted by it. No clock inside.
class StampCheck {
 public:
  static constexpr std::size_t kKept = 30, kFewest = 3;                ///< captures
  static constexpr Duration kLatest = std::chrono::milliseconds(400);  ///< mergers wait for 500
  static constexpr Duration kEarliest = std::chrono::milliseconds(-50);
  static constexpr Duration kHysteresis = std::chrono::milliseconds(20);

  /// The correction to add to timestamps; zero if they are right. `stamped`: end of exposure by the
  /// sensor's clock; `read`: by the computer's.
  Duration shift(TimePoint stamped, TimePoint read) {
    lags_.push_back(read - stamped);
    if (lags_.size() > kKept) lags_.pop_front();
    if (lags_.size() < kFewest) return shift_;
    const Duration least = *std::min_element(lags_.begin(), lags_.end());
    const bool is_right = least >= kEarliest && least <= kLatest;
    const Duration found = is_right ? Duration{} : least;
    if (std::chrono::abs(found - shift_) > kHysteresis) shift_ = found;
    return shift_;
  }

 private:
  std::deque<Duration> lags_;
  Duration shift_{};
};

}  // namespace mr::node
