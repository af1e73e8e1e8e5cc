#pragma once

namespace mr::calib {

struct RegistrationConfig {
  double voxel_m = 0.01;
  double reach_m = 0.1;  ///< surfaces farther apart are not taken for the same
};

/// A pair of parts counts from this shared area on.
inline constexpr double kLeastShared_m2 = 0.1;

}  // namespace mr::calib
