#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "mr/core/vec.h"

/// Solids as distance functions: negative inside, about metres to the surface.
namespace mr::synth {

/// A ball swept from `a` to `b` while its radius changes, then stretched along the axes about `a`;
/// with a == b an ellipsoid.
struct Solid {
  Vec3d a, b;
  double radius_a = 0, radius_b = 0;
  Vec3d stretch{1, 1, 1};
};

inline Solid ellipsoid(Vec3d center, Vec3d radii) { return {center, center, 1, 1, radii}; }

/// Distance to the surface; exact for balls and capsules, close to the surface for the others.
double distance(const Solid& solid, Vec3d p);

/// The lesser of two distances, rounded where they differ by less than `blend`.
inline double smooth_min(double a, double b, double blend) {
  const double near = std::max(blend - std::abs(a - b), 0.0);
  return std::min(a, b) - (blend > 0 ? near * near / (4 * blend) : 0);
}
inline double smooth_max(double a, double b, double blend) { return -smooth_min(-a, -b, blend); }

/// 0 below `from`, 1 above `to`, smooth between.
inline double smooth_step(double from, double to, double v) {
  const double t = std::clamp((v - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// 1 at the centre, fading to 0 over a few `width`s.
inline double bump(double v, double width) { return std::exp(-v * v / (width * width)); }

inline Vec3d mirrored(Vec3d p) { return {p.x, -p.y, p.z}; }
Solid mirrored(const Solid& solid);

}  // namespace mr::synth
