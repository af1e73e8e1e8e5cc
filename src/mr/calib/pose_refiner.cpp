#include "mr/calib/pose_refiner.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "mr/calib/outliers.h"
#include "mr/calib/overlaps.h"
#include "mr/calib/pose_graph.h"
#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/disjoint_sets.h"

namespace mr::calib {
namespace {

constexpr std::size_t kLeastMatches = 12;
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kStep_m = 0.001, kStep_rad = 0.05 * kDegree;  // per update
constexpr double kAtRest = 0.1;                                // of a step
constexpr double kMost_m = 0.05, kMost_rad = 2 * kDegree;      // altogether
constexpr double kFollow = 0.5;                                // of the way, per update
constexpr double kOdd_mm = 60;
constexpr double kWild = 2;        // times the limits
constexpr double kBetter = 0.999;  // costs after to costs before

double shift_m(const Motion& m) { return length(m.shift); }
double turn_rad(const Motion& m) { return length(m.turn) / kArm_m; }

/// About the eye (Rodrigues' formula).
Pose pose_of(const Motion& motion, Vec3d eye) {
  const double angle = turn_rad(motion);
  const Vec3d axis = normalized(motion.turn);
  const double c = std::cos(angle), s = std::sin(angle);
  Pose out;
  for (int column = 0; column < 3; ++column) {
    Vec3d unit;
    unit[column] = 1;
    const Vec3d turned = unit * c + cross(axis, unit) * s + axis * (dot(axis, unit) * (1 - c));
    for (int row = 0; row < 3; ++row) out.rotation(row, column) = turned[row];
  }
  out.translation = eye + motion.shift - out.rotation * eye;
  return out;
}

std::vector<Pose> poses_of(const Motions& corrections,
                           const std::vector<SampledSurface>& surfaces) {
  std::vector<Pose> out;
  for (std::size_t i = 0; i < corrections.size(); ++i)
    out.push_back(pose_of(corrections[i], surfaces[i].eye));
  return out;
}

/// What does not fit, with a limit for each match: the same before and after a motion.
double cost(const Correspondences& found, double trim_m) {
  double sum = found.through_m2 * trim_m * trim_m, area = found.through_m2;
  for (const Correspondence& m : found.matches) {
    const double apart = std::min(std::abs(m.apart_m), trim_m);
    sum += m.area_m2 * apart * apart, area += m.area_m2;
  }
  return area > 0 ? sum / area : trim_m * trim_m;
}

/// The overlaps that parts are aligned by.
std::vector<PairOverlap> sound(std::vector<PairOverlap> overlaps,
                               std::span<const std::uint32_t> odd) {
  const auto is_odd = [&](std::uint32_t part) { return std::ranges::find(odd, part) != odd.end(); };
  std::erase_if(overlaps, [&](const PairOverlap& o) {
    return o.residual.shared_m2 < kLeastShared_m2 || o.found.matches.size() < kLeastMatches ||
           !agree(o.residual, kOdd_mm) || is_odd(o.pair.a) || is_odd(o.pair.b);
  });
  return overlaps;
}

/// What is aligned, and how.
struct Plan {
  std::vector<PairOverlap> overlaps;
  Motions motions;            // the full way
  std::vector<double> after;  // cost() of the overlaps there, m²
};

bool beyond_limits(const Motion& m, double factor) {
  return shift_m(m) > factor * kMost_m || turn_rad(m) > factor * kMost_rad;
}

/// Parts that would have to go far beyond the limits are left out.
Plan plan_of(std::vector<PairOverlap> overlaps, const std::vector<SampledSurface>& surfaces,
             const Motions& corrections) {
  for (;;) {
    std::vector<NormalEquations> edges;
    for (const PairOverlap& o : overlaps) edges.push_back(normal_equations(o, surfaces));
    Motions motions = solve_pose_graph(edges, corrections);
    const auto too_far = [&](std::uint32_t i) {
      return beyond_limits(corrections[i] + motions[i], kWild);
    };
    const auto left_out = std::erase_if(
        overlaps, [&](const PairOverlap& o) { return too_far(o.pair.a) || too_far(o.pair.b); });
    if (left_out == 0) return {std::move(overlaps), std::move(motions), {}};
  }
}

void predict_costs(Plan& plan, const std::vector<SampledSurface>& surfaces,
                   const Motions& corrections, const RegistrationConfig& config) {
  Motions moved = corrections;
  for (std::size_t i = 0; i < moved.size(); ++i) moved[i] = moved[i] + plan.motions[i];
  const std::vector<Pose> poses = poses_of(moved, surfaces);
  plan.after.resize(plan.overlaps.size());
  parallel_for(plan.after.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const PairOverlap& o = plan.overlaps[i];
      plan.after[i] = cost(find_correspondences(surfaces, poses, o.pair, config), o.trim_m);
    }
  });
}

/// A plan without overlaps that no small motion explains: those that stay far apart and get little
/// nearer. They would pull the others off.
Plan checked_plan(std::vector<PairOverlap> overlaps, const std::vector<SampledSurface>& surfaces,
                  const Motions& corrections, const RegistrationConfig& config) {
  Plan plan = plan_of(std::move(overlaps), surfaces, corrections);
  predict_costs(plan, surfaces, corrections, config);
  std::vector<PairOverlap> explained;
  for (std::size_t i = 0; i < plan.after.size(); ++i) {
    const PairOverlap& o = plan.overlaps[i];
    const double rms_m = std::sqrt(plan.after[i]);
    if (rms_m <= kPoorResidual_m || rms_m <= 0.5 * o.residual.residual_mm / 1000)
      explained.push_back(o);
  }
  if (explained.size() == plan.overlaps.size()) return plan;
  plan = plan_of(std::move(explained), surfaces, corrections);
  predict_costs(plan, surfaces, corrections, config);
  return plan;
}

/// How much of its way each part goes: the same for parts that are linked, so that they keep
/// together. None where the full way would not bring them closer, or once one is at its limit.
std::vector<double> shares(const Plan& plan, const Motions& corrections) {
  const std::size_t parts = corrections.size();
  kit::DisjointSets sets(parts);
  for (const PairOverlap& o : plan.overlaps) sets.join(o.pair.a, o.pair.b);
  std::vector<double> gain(parts), of_set(parts, kFollow), out(parts);
  for (std::size_t i = 0; i < plan.overlaps.size(); ++i) {
    const PairOverlap& o = plan.overlaps[i];
    gain[sets.of(o.pair.a)] +=
        o.residual.shared_m2 * (kBetter * cost(o.found, o.trim_m) - plan.after[i]);
  }
  for (std::uint32_t i = 0; i < parts; ++i) {
    const Motion& m = plan.motions[i];
    const double steps = std::max(shift_m(m) / kStep_m, turn_rad(m) / kStep_rad);
    double& share = of_set[sets.of(i)];
    if (steps * share > 1) share = 1 / steps;
    if (!(gain[sets.of(i)] > 0)) share = 0;
  }
  for (std::uint32_t i = 0; i < parts; ++i)
    if (double& share = of_set[sets.of(i)];
        beyond_limits(corrections[i] + plan.motions[i] * share, 1))
      share = 0;
  for (std::uint32_t i = 0; i < parts; ++i) out[i] = of_set[sets.of(i)];
  return out;
}

}  // namespace

void move_part(const Pose& T, kit::Part& part) {
  for (Vec3f& p : part.mesh.positions) p = vec_cast<float>(T * vec_cast<double>(p));
  for (SourceInfo& s : part.sources) s.T_world_depth = T * s.T_world_depth;
}

std::vector<Pose> PoseRefiner::update(std::span<const kit::Part> parts,
                                      std::span<const std::uint64_t> ids) {
  MR_ASSERT(parts.size() == ids.size());
  const std::vector<SampledSurface> surfaces = sampled_surfaces(parts, config_.voxel_m);
  Motions corrections(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto known = std::ranges::find(corrections_, ids[i], &Correction::id);
    if (known != corrections_.end()) corrections[i] = {known->turn * kArm_m, known->shift};
  }

  std::vector<PairOverlap> overlaps =
      pair_overlaps(surfaces, poses_of(corrections, surfaces), config_);
  residuals_ = residuals_of(overlaps);
  const auto odd = outliers(residuals_, parts.size(), kOdd_mm);
  const Plan plan = checked_plan(sound(std::move(overlaps), odd), surfaces, corrections, config_);
  const std::vector<double> share = shares(plan, corrections);

  corrections_.clear();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Motion step = plan.motions[i] * share[i];
    if (shift_m(step) >= kAtRest * kStep_m || turn_rad(step) >= kAtRest * kStep_rad)
      corrections[i] = corrections[i] + step;
    corrections_.push_back({ids[i], corrections[i].turn / kArm_m, corrections[i].shift});
  }
  return poses_of(corrections, surfaces);
}

}  // namespace mr::calib
