#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/calib/residuals.h"
#include "mr/core/pose.h"
#include "mr/kit/part.h"

namespace mr::calib {

/// Moves a part's mesh and the poses of its sources: p' = T * p.
void move_part(const Pose& T, kit::Part& part);

/// Online refinement of extrinsic calibration: a small rigid correction per part that aligns
/// overlapping surfaces, by point-to-plane ICP over all pairs at once (Chen and Medioni 1992), one
/// Gauss-Newton step of the pose graph per update. The mean over all parts is kept. Motions that an
/// overlap does not constrain (such as along a plain wall) are not made. Outliers, and parts that
/// would need more than 100 mm or 4 degrees, are neither moved nor aligned to. Corrections are
/// applied in small steps, so that nothing jumps between frames: each sensor moves at most 1 mm and
/// 0.05 degrees per update and 50 mm and 2 degrees in all; it does not move for less than a tenth
/// of a step, nor if the full correction would not reduce the residuals. Overlapping parts move by
/// the same fraction of their corrections and stop together.
class PoseRefiner {
 public:
  explicit PoseRefiner(RegistrationConfig config) : config_(config) {}

  /// Takes the uncorrected parts, identified by `ids` (a part that was absent starts from zero),
  /// and makes one step. Returns the correction of each, p' = T * p, which also applies to the
  /// poses of its sources and views.
  std::vector<Pose> update(std::span<const kit::Part> parts, std::span<const std::uint64_t> ids);

  /// Residuals of the last update's parts, with the corrections before its step.
  const std::vector<PairResidual>& residuals() const { return residuals_; }

 private:
  struct Correction {
    std::uint64_t id = 0;
    Vec3d turn;   ///< about the part's eye: axis times angle, rad
    Vec3d shift;  ///< of the eye, m
  };

  RegistrationConfig config_;
  std::vector<Correction> corrections_;
  std::vector<PairResidual> residuals_;
};

}  // namespace mr::calib
