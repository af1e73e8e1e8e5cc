#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/calib/registration_config.h"
#include "mr/calib/sampled_surface.h"
#include "mr/core/pose.h"

namespace mr::calib {

/// Two parts whose boxes come near each other.
struct PartPair {
  std::uint32_t a, b;
  std::size_t stride_a, stride_b;  ///< of the samples that are projected
};
std::vector<PartPair> pairs_that_meet(const std::vector<SampledSurface>& surfaces,
                                      const RegistrationConfig& config);

/// A pair of corresponding surface points of two parts; world frame.
struct Correspondence {
  Vec3d point, normal;
  double apart_m;  ///< point-to-plane residual: how far a lies from b along the normal
  double area_m2;
};

/// The correspondences between two parts.
struct Correspondences {
  std::vector<Correspondence> matches;
  double through_m2 = 0;  ///< area of either that contradicts the other, which sees through it
};

/// Projective data association, both ways: samples of one part are projected into the depth views
/// of the other and meet the tangent plane there. `poses`: T_world_part of every part.
Correspondences find_correspondences(const std::vector<SampledSurface>& surfaces,
                                     std::span<const Pose> poses, const PartPair& pair,
                                     const RegistrationConfig& config);

/// Trimming threshold against outliers: 4.5 times the median residual (as in trimmed ICP).
double trim_limit_m(const Correspondences& found, const RegistrationConfig& config);

}  // namespace mr::calib
