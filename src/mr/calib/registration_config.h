#pragma once

namespace mr::calib {

struct RegistrationConfig {
  double voxel_m = 0.01;
  double reach_m = 0.1;  ///< largest distance of corresponding points
};

/// Least shared area for a pair of parts to count.
inline constexpr double kLeastShared_m2 = 0.1;

}  // namespace mr::calib
