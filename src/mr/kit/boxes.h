#pragma once

#include "mr/core/vec.h"

namespace mr::kit {

/// Whether two boxes overlap when one is enlarged by `reach_m` on all sides. Empty boxes never do.
inline bool meet(const Box3f& a, const Box3f& b, float reach_m) {
  const auto along = [&](int i) {
    return a.low[i] <= b.high[i] + reach_m && b.low[i] <= a.high[i] + reach_m;
  };
  return !a.empty() && !b.empty() && along(0) && along(1) && along(2);
}

}  // namespace mr::kit
