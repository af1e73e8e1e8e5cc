#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mr/eval/quality.h"
#include "mr/eval/sweep.h"

namespace mr::eval {

/// The constraint on a system: a bitrate, or a quality (mean masked SSIM).
struct OperatingTarget {
  std::optional<double> mbps, ssim;
};

/// The point of a system's rate-distortion curve that meets a target: the best quality within a
/// bitrate, or the lowest bitrate for a quality.
struct OperatingPoint {
  std::string pipeline, name;
  bool met = false;  ///< false: no setting meets it, and this is the nearest one
  SweepPoint point;
};

/// The settings that are varied for each pipeline (docs/evaluation.md).
SweepPlan operating_point_plan(const std::string& pipeline, const Scene& scene);

/// The Pareto front: the points that no other one dominates in bitrate and quality, by rising
/// bitrate and hence rising quality.
std::vector<SweepPoint> pareto_front(std::vector<SweepPoint> points);

/// The index of the point of a Pareto front that just meets a target; the nearest end if none does.
std::size_t crossing(const std::vector<SweepPoint>& points, const OperatingTarget& target);

/// Searches for a pipeline's operating point: a coarse sweep over all settings of
/// operating_point_plan() at one moment from few views, then the most promising ones in full.
/// `trial`: of the scene, with this pipeline.
Result<OperatingPoint> find_operating_point(const Trial& trial, const std::string& pipeline,
                                            const OperatingTarget& target,
                                            const QualityConfig& config);

}  // namespace mr::eval
