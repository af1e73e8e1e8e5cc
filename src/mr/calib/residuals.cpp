#include "mr/calib/residuals.h"

#include <cmath>

#include "mr/calib/overlaps.h"
#include "mr/core/parallel.h"

namespace mr::calib {
namespace {

constexpr double kLeastSharedArea = 0.85;  // shared of expected, of parts that agree

PairResidual residual_of(const PartPair& pair, const Correspondences& found, double trim_m) {
  PairResidual out{pair.a, pair.b, 0, 0, found.through_m2 / 2, 0};
  double squares = 0, area = 0, all_squares = 0, all_area = 0;
  for (const Correspondence& m : found.matches) {
    all_squares += m.area_m2 * m.apart_m * m.apart_m, all_area += m.area_m2;
    if (std::abs(m.apart_m) > trim_m) continue;
    squares += m.area_m2 * m.apart_m * m.apart_m, area += m.area_m2;
  }
  out.shared_m2 = area / 2, out.expected_m2 += area / 2;
  if (area > 0) out.residual_mm = std::sqrt(squares / area) * 1000;
  if (all_area > 0) out.untrimmed_mm = std::sqrt(all_squares / all_area) * 1000;
  return out;
}

}  // namespace

std::vector<PairOverlap> pair_overlaps(const std::vector<SampledSurface>& surfaces,
                                       std::span<const Pose> poses,
                                       const RegistrationConfig& config) {
  std::vector<PairOverlap> out;
  for (const PartPair& pair : pairs_that_meet(surfaces, config)) out.push_back({pair, {}, 0, {}});
  parallel_for(out.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      PairOverlap& o = out[i];
      o.found = find_correspondences(surfaces, poses, o.pair, config);
      o.trim_m = trim_limit_m(o.found, config);
      o.residual = residual_of(o.pair, o.found, o.trim_m);
    }
  });
  return out;
}

std::vector<PairResidual> residuals_of(const std::vector<PairOverlap>& overlaps) {
  std::vector<PairResidual> out;
  for (const PairOverlap& o : overlaps)
    if (o.residual.expected_m2 >= kLeastShared_m2) out.push_back(o.residual);
  return out;
}

std::vector<PairResidual> pair_residuals(std::span<const kit::Part> parts,
                                         const RegistrationConfig& config) {
  const std::vector<Pose> as_they_are(parts.size());
  return residuals_of(pair_overlaps(sampled_surfaces(parts, config.voxel_m), as_they_are, config));
}

bool agree(const PairResidual& r, double limit_mm) {
  return r.residual_mm <= limit_mm && r.shared_m2 >= kLeastSharedArea * r.expected_m2;
}

}  // namespace mr::calib
