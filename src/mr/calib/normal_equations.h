#pragma once

#include <cstdint>
#include <vector>

#include "mr/calib/matrix6.h"
#include "mr/calib/overlaps.h"
#include "mr/calib/sampled_surface.h"

namespace mr::calib {

/// Pairs that fit worse than this count less. Metres.
inline constexpr double kPoorResidual_m = 0.02;

/// The normal equations of point-to-plane ICP for one pair (Chen & Medioni 1992), linearized where
/// the parts are: the sum over its correspondences of squared distances after a small motion of a
/// against b, per area. Directions that the overlap leaves open are taken out.
struct NormalEquations {
  std::uint32_t a = 0, b = 0;
  Vec3d arm_a, arm_b;  ///< from the eyes of a and b to the middle of the overlap
  double radius_m = 1;
  double weight = 0;
  Mat6 JtJ{};  ///< by turn · radius and shift in the middle
  Vec6 Jtr{};
};
NormalEquations normal_equations(const PairOverlap& overlap,
                                 const std::vector<SampledSurface>& surfaces);

}  // namespace mr::calib
