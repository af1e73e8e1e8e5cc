#pragma once

#include <limits>

namespace mr::node {

/// What a packet may bring of something that can wait.
struct Allowance {
  double bytes = std::numeric_limits<double>::infinity();
  bool one_anyway = false;  ///< the first piece is to come, however many bytes it has

  /// Whether a piece may come; then it does.
  bool take(double piece) {
    if (piece > bytes && !one_anyway) return false;
    bytes -= piece, one_anyway = false;
    return true;
  }
};

/// What the atlas of clean plates may take.
struct PlateLimits {
  Allowance now;
  double largest_bytes = std::numeric_limits<double>::infinity();  ///< that `now` may ever be
  bool may_refine = true;  ///< else only what is new is sent
};

}  // namespace mr::node
