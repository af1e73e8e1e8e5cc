#pragma once

#include <algorithm>
#include <chrono>
#include <optional>

#include "mr/core/frame.h"

namespace mr::node {

/// A token bucket: limits a long-term rate and a burst size. No clock inside.
class TokenBucket {
 public:
  TokenBucket(double per_second, double burst)
      : per_second_(per_second), burst_(burst), left_(burst) {}

  /// The tokens available now; negative after overspending.
  double left(TimePoint now) {
    if (filled_ && now > *filled_) {
      const double seconds = std::chrono::duration<double>(now - *filled_).count();
      left_ = std::min(burst_, left_ + per_second_ * seconds);
    }
    filled_ = now;
    return left_;
  }
  void spend(double amount) { left_ -= amount; }

 private:
  double per_second_, burst_, left_;
  std::optional<TimePoint> filled_;
};

}  // namespace mr::node
