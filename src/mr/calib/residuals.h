#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/calib/registration_config.h"
#include "mr/kit/part.h"

namespace mr::calib {

/// The residual between the overlapping surfaces of two parts: a live check of calibration.
struct PairResidual {
  std::uint32_t a = 0, b = 0;  ///< places of the parts, a < b
  double residual_mm = 0;      ///< RMS point-to-plane distance, both ways, trimmed
  double shared_m2 = 0;        ///< overlap, without borders and sharp edges
  /// The overlap expected from visibility: the shared area, and the area of either that the other
  /// sees through. Of calibrated parts at least 98 % is shared; less if one is far off.
  double expected_m2 = 0;
  /// As residual_mm but without trimming at 4.5 times the median: also shows an error that only a
  /// few walls reveal.
  double untrimmed_mm = 0;
};

/// Residuals of all pairs that should share at least 0.1 m2, in order of (a, b). Parallel;
/// deterministic; costs a fraction of the merge.
std::vector<PairResidual> pair_residuals(std::span<const kit::Part> parts,
                                         const RegistrationConfig& config);

/// Whether two parts agree: their residual is at most `limit_mm`, and they share at least 85 % of
/// the expected area.
bool agree(const PairResidual& residual, double limit_mm);

}  // namespace mr::calib
