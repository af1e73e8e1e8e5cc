#include "mr/calib/pose_graph.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace mr::calib {
namespace {

constexpr double kPrior = 3e-4;  // weight of no correction at all, against that of the overlaps

/// The motion of a against b in the middle of their overlap.
Vec6 relative(const NormalEquations& edge, const Motions& motions) {
  const Motion &a = motions[edge.a], &b = motions[edge.b];
  const Vec3d turn = (a.turn - b.turn) * (edge.radius_m / kArm_m);
  const Vec3d shift =
      a.shift + cross(a.turn, edge.arm_a) / kArm_m - b.shift - cross(b.turn, edge.arm_b) / kArm_m;
  return {turn.x, turn.y, turn.z, shift.x, shift.y, shift.z};
}

/// The transpose of relative(): adds what a gradient in the overlap is for the two parts.
void add_transposed(const NormalEquations& edge, const Vec6& gradient, double factor,
                    Motions& out) {
  const Vec3d turn =
      Vec3d{gradient[0], gradient[1], gradient[2]} * (factor * edge.radius_m / kArm_m);
  const Vec3d push = Vec3d{gradient[3], gradient[4], gradient[5]} * factor;
  out[edge.a].shift += push, out[edge.b].shift += -push;
  out[edge.a].turn += turn + cross(edge.arm_a, push) / kArm_m;
  out[edge.b].turn += -turn - cross(edge.arm_b, push) / kArm_m;
}

}  // namespace

Motions solve_pose_graph(const std::vector<NormalEquations>& edges, const Motions& corrections) {
  const std::size_t parts = corrections.size();
  double prior = 0;
  Motions residual(parts), motions(parts);
  std::vector<std::uint8_t> linked(parts);
  for (const NormalEquations& edge : edges) {
    add_transposed(edge, edge.Jtr, -edge.weight, residual);
    prior += 2 * kPrior * edge.weight;
    linked[edge.a] = linked[edge.b] = 1;
  }
  const auto count = std::count(linked.begin(), linked.end(), 1);
  if (count == 0) return motions;
  prior /= static_cast<double>(count);
  for (std::size_t i = 0; i < parts; ++i)
    if (linked[i]) residual[i] = residual[i] + corrections[i] * -prior;

  Motions direction = residual, product(parts);
  double left = dot(residual, residual);
  const double enough = 1e-12 * left;
  for (std::size_t step = 0; step < std::min<std::size_t>(6 * parts, 300) && left > enough;
       ++step) {
    for (std::size_t i = 0; i < parts; ++i) product[i] = direction[i] * prior;
    for (const NormalEquations& edge : edges)
      add_transposed(edge, edge.JtJ * relative(edge, direction), edge.weight, product);
    const double length = left / dot(direction, product), before = left;
    for (std::size_t i = 0; i < parts; ++i)
      motions[i] = motions[i] + direction[i] * length,
      residual[i] = residual[i] + product[i] * -length;
    left = dot(residual, residual);
    for (std::size_t i = 0; i < parts; ++i)
      direction[i] = residual[i] + direction[i] * (left / before);
  }
  return motions;
}

}  // namespace mr::calib
