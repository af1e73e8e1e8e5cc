#include "mr/rate/hull_targets.h"

#include <algorithm>
#include <cmath>

#include "mr/core/assert.h"

namespace mr::rate {

std::vector<double> log_spaced(double low, double high, int count) {
  MR_ASSERT(low > 0 && high >= low && count > 1);
  std::vector<double> out;
  for (int i = 0; i < count; ++i) out.push_back(low * std::pow(high / low, i / (count - 1.0)));
  return out;
}

std::vector<double> targets_of(const std::vector<RatePoint>& hull, int count) {
  MR_ASSERT(!hull.empty());
  const double enough = hull.front().ssim + 0.99 * (hull.back().ssim - hull.front().ssim);
  const auto above =
      std::ranges::find_if(hull, [&](const RatePoint& p) { return p.ssim >= enough; });
  double high = above->mbps;
  if (above != hull.begin() && above->ssim > (above - 1)->ssim) {
    const RatePoint& below = *(above - 1);
    high = below.mbps +
           (enough - below.ssim) / (above->ssim - below.ssim) * (above->mbps - below.mbps);
  }
  return log_spaced(hull.front().mbps, std::max(high, hull.front().mbps), count);
}

}  // namespace mr::rate
