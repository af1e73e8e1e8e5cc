#pragma once

#include <cstdint>
#include <vector>

#include "mr/calib/matrix6.h"
#include "mr/calib/overlaps.h"
#include "mr/calib/sampled_surface.h"

namespace mr::calib {

/// Pairs with a larger residual are down-weighted. Metres.
inline constexpr double kPoorResidual_m = 0.02;

/// The normal equations JtJ x = -Jtr of point-to-plane ICP for one pair (Chen and Medioni 1992),
/// linearized at the current poses: the sum of squared point-to-plane distances over the
/// correspondences after a small motion x of a against b, per area. Directions that the overlap
/// does not constrain are projected out.
struct NormalEquations {
  std::uint32_t a = 0, b = 0;
  Vec3d arm_a, arm_b;  ///< from the eyes of a and b to the middle of the overlap
  double radius_m = 1;
  double weight = 0;
  Mat6 JtJ{};  ///< in (rotation · radius, translation) at the centre of the overlap
  Vec6 Jtr{};
};
NormalEquations normal_equations(const PairOverlap& overlap,
                                 const std::vector<SampledSurface>& surfaces);

}  // namespace mr::calib
