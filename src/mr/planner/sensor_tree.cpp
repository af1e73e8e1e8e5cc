#include "mr/planner/sensor_tree.h"

#include <algorithm>
#include <bit>
#include <optional>
#include <utility>
#include <vector>

#include "mr/planner/latency_model.h"
#include "mr/planner/merger_ids.h"
#include "mr/planner/sensor_clusters.h"

namespace mr::planner {
namespace {

/// Builds a tree of groups, layer by layer.
class TreeBuilder {
 public:
  explicit TreeBuilder(const Coverage& coverage) : coverage_(&coverage), ids_(*coverage.scene) {}

  /// The first layer.
  void add_sensor_groups(std::vector<SensorSet> groups) {
    std::sort(groups.begin(), groups.end(), first_sensor_first);
    for (const SensorSet& group : groups) {
      const std::vector<SensorSet> inputs = one_by_one(*coverage_, group);
      PlannedMerger merger;
      merger.config.id = ids_.next("merger", ++count_);
      merger.config.inputs = sensor_ids(*coverage_, group);
      merger.config.deadline_ms = first_deadline_ms(*coverage_->scene);
      set_load(merger, load_of(*coverage_, inputs), group, *coverage_);
      below_.emplace_back(group, plan_.mergers.size());
      plan_.mergers.push_back(std::move(merger));
    }
  }

  /// Mergers above those of the layer before, which are in one of these groups each.
  void add_layer(std::vector<SensorSet> groups) {
    std::sort(groups.begin(), groups.end(), first_sensor_first);
    std::vector<std::pair<SensorSet, std::size_t>> above;
    for (const SensorSet& group : groups) {
      std::vector<SensorSet> inputs;
      std::vector<const PlannedMerger*> nodes;
      PlannedMerger merger;
      for (const auto& [sensors, place] : below_)
        if (common(sensors, group) > 0) {
          inputs.push_back(sensors), nodes.push_back(&plan_.mergers[place]);
          merger.config.inputs.push_back(nodes.back()->config.id);
        }
      merger.layer = nodes.front()->layer + 1;
      merger.config.id = groups.size() == 1 ? ids_.root : ids_.next("upper", ++upper_);
      merger.config.deadline_ms = deadline_above_ms(nodes);
      set_load(merger, load_of(*coverage_, inputs), group, *coverage_);
      above.emplace_back(group, plan_.mergers.size());
      plan_.mergers.push_back(std::move(merger));
    }
    below_ = std::move(above);
  }

  Plan take() { return std::move(plan_); }

 private:
  static bool first_sensor_first(const SensorSet& a, const SensorSet& b) {
    for (std::size_t w = 0; w < a.size(); ++w) {
      const int x = std::countr_zero(a[w]), y = std::countr_zero(b[w]);
      if (x != y || x < 64) return x < y;
    }
    return false;
  }

  const Coverage* coverage_;
  MergerIds ids_;
  int count_ = 0, upper_ = 0;
  std::vector<std::pair<SensorSet, std::size_t>> below_;  // the layer before, places in the plan
  Plan plan_;
};

/// A tree of sensor groups: `uppers` of the mergers make a layer of their own.
Plan tree_of_clusters(const Coverage& coverage, const SensorClusters& leaves, std::size_t uppers,
                      double slack) {
  TreeBuilder builder(coverage);
  builder.add_sensor_groups(leaves.groups);
  if (uppers > 0) builder.add_layer(clustered(leaves, uppers, slack).groups);
  builder.add_layer({all_sensors(coverage)});
  return builder.take();
}

}  // namespace

Plan best_sensor_tree(const Coverage& coverage, const PlanConfig& config) {
  constexpr double kClearly = 0.95;
  const SensorClusters single = one_each(coverage);
  std::optional<Plan> best;
  const std::size_t n = static_cast<std::size_t>(config.mergers);
  for (const std::size_t uppers : {std::size_t{0}, (n + 7) / 8, (n + 3) / 4}) {
    if (uppers > 0 && (uppers < 2 || n - uppers < 2 * uppers)) continue;
    for (const double slack : {1.15, 1.5, 2.5, 1e9}) {
      Plan plan = tree_of_clusters(coverage, clustered(single, n - uppers, slack), uppers, slack);
      add_latencies(plan, coverage, config);
      if (!best || plan.latency_ms < kClearly * best->latency_ms) best = std::move(plan);
    }
  }
  return *std::move(best);
}

Plan single_merger(const Coverage& coverage, const PlanConfig& config) {
  TreeBuilder builder(coverage);
  builder.add_sensor_groups({all_sensors(coverage)});
  Plan plan = builder.take();
  plan.mergers.front().config.id = coverage.scene->mergers.back().id;
  add_latencies(plan, coverage, config);
  return plan;
}

}  // namespace mr::planner
