#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/calib/registration_config.h"
#include "mr/kit/part.h"

namespace mr::calib {

/// How far the surfaces of two parts lie apart where both see the same: a live check of
/// calibration.
struct PairResidual {
  std::uint32_t a = 0, b = 0;  ///< places of the parts, a < b
  double residual_mm = 0;      ///< RMS distance from points of one to the planes of the other
  double shared_m2 = 0;        ///< area that both see; borders and sharp edges are left out
  /// Shared area, and what of either lies where the other sees through it to something farther: of
  /// two parts that fit, 98 % and more is shared; less when one is far off.
  double expected_m2 = 0;
  /// As residual_mm, which leaves out what lies over 4.5 times the median apart, but with it: tells
  /// also an error that only a few walls show.
  double untrimmed_mm = 0;
};

/// Residuals of all pairs that should share at least 0.1 m2, in order of (a, b). Parallel;
/// deterministic; costs a fraction of the merge.
std::vector<PairResidual> pair_residuals(std::span<const kit::Part> parts,
                                         const RegistrationConfig& config);

/// Whether two parts fit: their residual is at most `limit_mm`, and they share at least 85 % of
/// what they should.
bool agree(const PairResidual& residual, double limit_mm);

}  // namespace mr::calib
