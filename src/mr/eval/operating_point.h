#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mr/eval/quality.h"
#include "mr/eval/sweep.h"

namespace mr::eval {

/// What a system has to meet: a rate, or a quality (mean masked SSIM).
struct OperatingTarget {
  std::optional<double> mbps, ssim;
};

/// A system's best setting: the best quality within a rate, or the lowest rate for a quality.
struct OperatingPoint {
  std::string pipeline, name;
  bool met = false;  ///< no setting did where false: then the one that comes nearest
  SweepPoint point;
};

/// What EVALUATION lets each pipeline vary.
SweepPlan operating_point_plan(const std::string& pipeline, const Scene& scene);

/// The points that no other beats in both, by rising rate and so by rising quality.
std::vector<SweepPoint> pareto_front(std::vector<SweepPoint> points);

/// The place on a front where a target is just met; the nearest end where it is met nowhere.
std::size_t crossing(const std::vector<SweepPoint>& points, const OperatingTarget& target);

/// Tries all of operating_point_plan() at one moment from few views, and the most promising
/// settings again in full. The trial's scene, with this pipeline.
Result<OperatingPoint> find_operating_point(const Trial& trial, const std::string& pipeline,
                                            const OperatingTarget& target,
                                            const QualityConfig& config);

}  // namespace mr::eval
