#include "mr/synth/solid.h"

namespace mr::synth {
namespace {

Vec3d divided(Vec3d a, Vec3d b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }

}  // namespace

double distance(const Solid& s, Vec3d p) {
  const Vec3d q = divided(p - s.a, s.stretch), axis = divided(s.b - s.a, s.stretch);
  const double length2 = dot(axis, axis);
  const double t = length2 > 0 ? std::clamp(dot(q, axis) / length2, 0.0, 1.0) : 0;
  const double radius = s.radius_a + (s.radius_b - s.radius_a) * t;
  const Vec3d off = q - axis * t;
  const double steep = length(divided(off, s.stretch)) / (radius * radius);
  if (steep < 1e-9) return -radius * std::min({s.stretch.x, s.stretch.y, s.stretch.z});
  const double relative = length(off) / radius;
  return relative * (relative - 1) / steep;
}

Solid mirrored(const Solid& solid) {
  Solid out = solid;
  out.a = mirrored(solid.a), out.b = mirrored(solid.b);
  return out;
}

}  // namespace mr::synth
