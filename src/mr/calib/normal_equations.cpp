#include "mr/calib/normal_equations.h"

#include <algorithm>
#include <cmath>

namespace mr::calib {
namespace {

constexpr double kLeastObserved = 0.01;  // a direction is open where less of the overlap holds it

}  // namespace

NormalEquations normal_equations(const PairOverlap& overlap,
                                 const std::vector<SampledSurface>& surfaces) {
  const auto& [pair, found, trim_m, residual] = overlap;
  NormalEquations out;
  out.a = pair.a, out.b = pair.b;
  double area = 0, spread = 0;
  Vec3d sum;
  for (const Correspondence& m : found.matches)
    if (std::abs(m.apart_m) <= trim_m) area += m.area_m2, sum += m.point * m.area_m2;
  const Vec3d middle = sum / area;
  for (const Correspondence& m : found.matches)
    if (std::abs(m.apart_m) <= trim_m)
      spread += m.area_m2 * dot(m.point - middle, m.point - middle);
  out.radius_m = std::max(std::sqrt(spread / area), 0.05);
  for (const Correspondence& m : found.matches) {
    if (std::abs(m.apart_m) > trim_m) continue;
    const Vec3d turn = cross(m.point - middle, m.normal) / out.radius_m;
    const Vec6 row{turn.x, turn.y, turn.z, m.normal.x, m.normal.y, m.normal.z};  // of J
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) out.JtJ[i][j] += m.area_m2 / area * row[i] * row[j];
      out.Jtr[i] += m.area_m2 / area * row[i] * m.apart_m;
    }
  }
  const Mat6 observable = observable_directions(out.JtJ, kLeastObserved);
  out.JtJ = observable * out.JtJ, out.Jtr = observable * out.Jtr;
  const double poor = residual.residual_mm / 1000 / kPoorResidual_m;
  out.weight = residual.shared_m2 / (1 + poor * poor);
  out.arm_a = middle - surfaces[pair.a].eye, out.arm_b = middle - surfaces[pair.b].eye;
  return out;
}

}  // namespace mr::calib
