#include "mr/planner/planner.h"

#include <fmt/format.h>

#include <utility>

#include "mr/planner/coverage.h"
#include "mr/planner/grid_estimate.h"
#include "mr/planner/region_tree.h"
#include "mr/planner/sensor_tree.h"

namespace mr::planner {
namespace {

/// Share of what the root gets that several of its inputs saw.
double shared_at_root(const Plan& plan) {
  const PlannedMerger& root = plan.mergers.back();
  return root.triangles_in > 0 ? root.triangles_shared / root.triangles_in : 0;
}

Result<Plan> choose(const Coverage& coverage, const PlanConfig& config) {
  constexpr double kCrowded = 0.5;     // of the root's triangles
  constexpr double kDearAtMost = 1.1;  // times the latency: for a root that has nothing to decide
  if (config.mergers == 1) {
    Plan plan = single_merger(coverage, config);
    plan.why = "one merger for all sensors";
    return plan;
  }
  std::optional<Plan> groups, regions;
  if (config.split != Split::space) groups = best_sensor_tree(coverage, config);
  const double shared = groups ? shared_at_root(*groups) : 1;
  if (config.split == Split::space || (!config.split && shared > kCrowded))
    regions = region_tree(coverage, config);
  if (!groups && !regions)
    return Error{Error::Cause::invalid,
                 fmt::format("the space cannot be split into {} regions: its cubes of "
                             "fusion.chunk_m = {} m are too few",
                             config.mergers, coverage.scene->fusion.chunk_m)};
  const auto say = [&](Plan& plan, const std::string& why) {
    plan.why = why;
    return std::move(plan);
  };
  if (!groups) return say(*regions, "by region of space, as asked for");
  const std::string seen = fmt::format(
      "{:.0f} % of what the root would get from groups of sensors "
      "is seen by several of them",
      100 * shared);
  if (!regions)
    return say(*groups, config.split        ? "by group of sensors, as asked for"
                        : shared > kCrowded ? seen + ", but the space has too few cubes to be split"
                                            : "by group of sensors: " + seen);
  const std::string both = fmt::format("{:.0f} ms against {:.0f} ms for groups",
                                       regions->latency_ms, groups->latency_ms);
  if (regions->latency_ms <= kDearAtMost * groups->latency_ms)
    return say(*regions, "by region of space: the sensors crowd one place (" + seen + "), " + both);
  return say(*groups, "by group of sensors, though they crowd one place (" + seen +
                          "): regions would need " + both);
}

Status check(const Scene& scene, std::span<const SensorSample> samples, const PlanConfig& config) {
  const auto refuse = [](const std::string& why) { return Error{Error::Cause::invalid, why}; };
  constexpr int kMost = 255;  // of scene files, less the root
  if (scene.sensors.empty() || scene.mergers.empty() || samples.size() != scene.sensors.size())
    return refuse("scene '" + scene.id + "' has no sensors to plan for");
  if (config.mergers < 1) return refuse("a tree needs at least 1 merger");
  if (static_cast<std::size_t>(config.mergers) > scene.sensors.size())
    return refuse(fmt::format("{} mergers are more than the scene's {} sensors", config.mergers,
                              scene.sensors.size()));
  if (config.mergers > kMost)
    return refuse(fmt::format("{} mergers are too many: at most {}", config.mergers, kMost));
  return {};
}

}  // namespace

Result<Plan> make_plan(const Scene& scene, std::span<const SensorSample> samples,
                       const MergeCosts& costs, const PlanConfig& config) {
  if (const Status good = check(scene, samples, config); !good) return good.error();
  const Coverage coverage = make_coverage(scene, samples, costs);
  auto plan = choose(coverage, config);
  if (!plan) return plan.error();
  const Plan one = single_merger(coverage, config);
  plan->central = one.mergers.front();
  plan->central_latency_ms = one.latency_ms;
  plan->one_grid = estimate_grid(coverage, samples, plan->central);
  return plan;
}

}  // namespace mr::planner
