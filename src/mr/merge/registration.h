#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/pose.h"
#include "mr/merge/part.h"

namespace mr::merge {

/// How far the surfaces of two parts lie apart where both see the same: a live check of
/// calibration.
struct PairResidual {
  std::uint32_t a = 0, b = 0;  ///< places of the parts, a < b
  double residual_mm = 0;      ///< RMS distance from points of one to the planes of the other
  double shared_m2 = 0;        ///< area that both see
};

struct RegistrationConfig {
  double voxel_m = 0.01;
  double reach_m = 0.1;  ///< surfaces farther apart are not taken for the same
};

/// Residuals of all pairs that share at least 0.1 m2 (of parts whose frusta meet). Parallel;
/// deterministic; costs a fraction of the merge.
std::vector<PairResidual> pair_residuals(std::span<const Part> parts,
                                         const RegistrationConfig& config);

/// A small rigid correction per part that brings overlapping surfaces together: point-to-plane ICP
/// over all pairs at once (Chen & Medioni 1992), the mean of all parts held still. Corrections are
/// followed slowly, so nothing jumps from frame to frame: per update at most 1 mm and 0.05 degrees,
/// and none at all below a tenth of that; together at most 50 mm and 2 degrees.
class Refiner {
 public:
  explicit Refiner(RegistrationConfig config) : config_(config) {}

  /// Looks at uncorrected parts, named by `ids` (a part that was away starts anew), and takes a
  /// step. Returns T_world_part for each: p' = T * p; also for its sources' and views' poses.
  std::vector<Pose> update(std::span<const Part> parts, std::span<const std::uint64_t> ids);

 private:
  RegistrationConfig config_;
};

}  // namespace mr::merge
