#pragma once

#include <span>
#include <vector>

#include "mr/calib/correspondences.h"
#include "mr/calib/residuals.h"

namespace mr::calib {

/// Two parts, what they show of each other, and how far that lies apart.
struct PairOverlap {
  PartPair pair;
  Correspondences found;
  double trim_m = 0;
  PairResidual residual;
};

/// Of all pairs that come near each other. Parallel.
std::vector<PairOverlap> pair_overlaps(const std::vector<SampledSurface>& surfaces,
                                       std::span<const Pose> poses,
                                       const RegistrationConfig& config);

/// Those of overlaps that should be large enough to tell anything.
std::vector<PairResidual> residuals_of(const std::vector<PairOverlap>& overlaps);

}  // namespace mr::calib
