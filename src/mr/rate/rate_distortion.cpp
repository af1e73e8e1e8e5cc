#include "mr/rate/rate_distortion.h"

#include <algorithm>
#include <tuple>

#include "mr/core/assert.h"

namespace mr::rate {

std::vector<RatePoint> measured_points(const Sweep& sweep) {
  std::vector<RatePoint> out;
  for (const Sweep::Quality& q : sweep.qualities) {
    const Sweep::Geometry& g = sweep.geometries[q.geometry];
    const Sweep::Texture& t = sweep.textures[q.texture];
    out.push_back({{g.error_voxels, g.bits, t.scale, t.qp},
                   sweep.geometry_mbps(g) + sweep.texture_mbps(t),
                   q.ssim});
  }
  return out;
}

std::vector<RatePoint> convex_hull(std::vector<RatePoint> points) {
  std::ranges::sort(points, [](const RatePoint& a, const RatePoint& b) {
    return std::tuple(a.mbps, -a.ssim) < std::tuple(b.mbps, -b.ssim);
  });
  // Whether the slope from a to b is no greater than that from b to c: b lies below the line.
  const auto is_below = [](const RatePoint& a, const RatePoint& b, const RatePoint& c) {
    return (b.ssim - a.ssim) * (c.mbps - b.mbps) <= (c.ssim - b.ssim) * (b.mbps - a.mbps);
  };
  std::vector<RatePoint> hull;
  for (const RatePoint& p : points) {
    if (!hull.empty() && p.ssim <= hull.back().ssim) continue;
    while (hull.size() >= 2 && is_below(hull[hull.size() - 2], hull.back(), p)) hull.pop_back();
    hull.push_back(p);
  }
  return hull;
}

double hull_ssim(const std::vector<RatePoint>& hull, double mbps) {
  MR_ASSERT(!hull.empty());
  const auto above = std::ranges::find_if(hull, [&](const RatePoint& p) { return p.mbps > mbps; });
  if (above == hull.begin()) return hull.front().ssim;
  if (above == hull.end()) return hull.back().ssim;
  const auto below = above - 1;
  const double share = (mbps - below->mbps) / (above->mbps - below->mbps);
  return below->ssim + share * (above->ssim - below->ssim);
}

}  // namespace mr::rate
