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
  double shared_m2 = 0;        ///< area that both see; borders and sharp edges are left out
  /// Shared area, and what of either lies where the other sees through it to something farther: of
  /// two parts that fit, 98 % and more is shared; less when one is far off.
  double expected_m2 = 0;
  /// As residual_mm, which leaves out what lies over 4.5 times the median apart, but with it: tells
  /// also an error that only a few walls show.
  double untrimmed_mm = 0;
};

struct RegistrationConfig {
  double voxel_m = 0.01;
  double reach_m = 0.1;  ///< surfaces farther apart are not taken for the same
};

/// Residuals of all pairs that should share at least 0.1 m2, in order of (a, b). Parallel;
/// deterministic; costs a fraction of the merge.
std::vector<PairResidual> pair_residuals(std::span<const Part> parts,
                                         const RegistrationConfig& config);

/// The parts that do not fit the others, in order. Two parts agree when their residual is at most
/// `limit_mm` and they share at least 85 % of what they should. Of parts that overlap, the largest
/// group that agrees among itself is taken for right, and those that disagree with most of it are
/// named. Where no group is the largest (as with two parts only), no one can tell: none is named.
std::vector<std::uint32_t> outliers(std::span<const PairResidual> residuals, std::size_t parts,
                                    double limit_mm);

/// A small rigid correction per part that brings overlapping surfaces together: point-to-plane ICP
/// over all pairs at once (Chen & Medioni 1992), the mean of all parts held still. What an overlap
/// leaves open (along a plain wall, say) is not followed, nor are parts that do not fit the others
/// or that would need more than 100 mm or 4 degrees: they stay where they are, and nothing is
/// aligned to them. Corrections are followed slowly, so nothing jumps from frame to frame: per
/// update each sensor moves by at most 1 mm and turns by at most 0.05 degrees, together at most
/// 50 mm and 2 degrees; not at all below a tenth of the step, and not when the full correction
/// would not make the residuals smaller. Parts that overlap go the same share of their ways and
/// stop together.
class Refiner {
 public:
  explicit Refiner(RegistrationConfig config) : config_(config) {}

  /// Looks at uncorrected parts, named by `ids` (a part that was away starts anew), and takes a
  /// step. Returns T_world_part for each: p' = T * p; also for its sources' and views' poses.
  std::vector<Pose> update(std::span<const Part> parts, std::span<const std::uint64_t> ids);

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

}  // namespace mr::merge
