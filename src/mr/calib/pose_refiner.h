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

/// A small rigid correction per part that brings overlapping surfaces together: point-to-plane ICP
/// over all pairs at once (Chen & Medioni 1992; one Gauss-Newton step of the pose graph an update),
/// the mean of all parts held still. What an overlap leaves open (along a plain wall, say) is not
/// followed, nor are parts that do not fit the others or that would need more than 100 mm or 4
/// degrees: they stay where they are, and nothing is aligned to them. Corrections are followed
/// slowly, so nothing jumps from frame to frame: per update each sensor moves by at most 1 mm and
/// turns by at most 0.05 degrees, together at most 50 mm and 2 degrees; not at all below a tenth of
/// the step, and not when the full correction would not make the residuals smaller. Parts that
/// overlap go the same share of their ways and stop together.
class PoseRefiner {
 public:
  explicit PoseRefiner(RegistrationConfig config) : config_(config) {}

  /// Looks at uncorrected parts, named by `ids` (a part that was away starts anew), and takes a
  /// step. Returns T_world_part for each: p' = T * p; also for its sources' and views' poses.
  std::vector<Pose> update(std::span<const kit::Part> parts, std::span<const std::uint64_t> ids);

  /// Of the last update's parts, with the corrections they had before its step.
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
