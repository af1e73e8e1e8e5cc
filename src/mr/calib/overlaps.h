#pragma once

#include <span>
#include <vector>

#include "mr/calib/correspondences.h"
#include "mr/calib/residuals.h"

namespace mr::calib {

/// Two parts with their correspondences and residual.
struct PairOverlap {
  PartPair pair;
  Correspondences found;
  double trim_m = 0;
  PairResidual residual;
};

/// The overlaps of all pairs of parts near each other. Parallel.
std::vector<PairOverlap> pair_overlaps(const std::vector<SampledSurface>& surfaces,
                                       std::span<const Pose> poses,
                                       const RegistrationConfig& config);

/// The residuals of overlaps whose expected area is large enough.
std::vector<PairResidual> residuals_of(const std::vector<PairOverlap>& overlaps);

}  // namespace mr::calib
