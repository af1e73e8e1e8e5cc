#include "mr/planner/region_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "mr/node/chunk_grid.h"
#include "mr/planner/latency_model.h"
#include "mr/planner/merger_ids.h"

namespace mr::planner {
namespace {

/// Where to cut a box so that its parts, `first` and `second` of them, have about the same to do;
/// nothing when there are too few cubes.
std::optional<std::int32_t> best_cut(const Coverage& coverage, const CubeBox& box, int axis,
                                     int first, int second) {
  std::map<std::int32_t, double> at;
  double total = 0;
  for (const SurfacePoint& point : coverage.points)
    if (const Vec3i cube = node::cube_of(point.at, coverage.scene->fusion.chunk_m);
        holds(box, cube, 0))
      at[cube[axis]] += point.triangles, total += point.triangles;
  if (at.empty()) return std::nullopt;
  std::optional<std::int32_t> best;
  double best_off = 0, below = 0;
  for (std::int32_t cut = at.begin()->first + 1; cut <= at.rbegin()->first; ++cut) {
    if (const auto before = at.find(cut - 1); before != at.end()) below += before->second;
    CubeBox low = box, high = box;
    low.high[axis] = high.low[axis] = cut;
    if (low.count() < first || high.count() < second) continue;
    const double off = std::abs(below / total - static_cast<double>(first) / (first + second));
    if (!best || off < best_off) best = cut, best_off = off;
  }
  return best;
}

/// Cuts a box into `parts` regions, across its longest side where there is surface; false when it
/// has too few cubes.
bool cut_space(const Coverage& coverage, const CubeBox& box, int parts, std::vector<CubeBox>& out) {
  if (parts == 1) {
    out.push_back(box);
    return true;
  }
  Box3d surface;
  for (const SurfacePoint& point : coverage.points)
    if (holds(box, node::cube_of(point.at, coverage.scene->fusion.chunk_m), 0))
      surface.add(point.at);
  if (surface.empty()) return false;
  std::array<int, 3> axes{0, 1, 2};
  const Vec3d size = surface.high - surface.low;
  std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return size[a] > size[b]; });
  const int first = parts / 2, second = parts - first;
  for (const int axis : axes) {
    const auto cut = best_cut(coverage, box, axis, first, second);
    if (!cut) continue;
    CubeBox low = box, high = box;
    low.high[axis] = high.low[axis] = *cut;
    const std::size_t before = out.size();
    if (cut_space(coverage, low, first, out) && cut_space(coverage, high, second, out)) return true;
    out.resize(before);
  }
  return false;
}

/// The sensors that may see something of a region or of the cubes around it.
std::vector<SensorSet> groups_of(const Coverage& coverage, const std::vector<CubeBox>& regions) {
  const double chunk_m = coverage.scene->fusion.chunk_m;
  std::vector<SensorSet> out(regions.size(), coverage.none());
  for (std::size_t i = 0; i < coverage.sensors(); ++i) {
    bool any = false;
    for (std::size_t r = 0; r < regions.size(); ++r)
      if (coverage.frusta[i].may_see(regions[r].box(chunk_m, 1))) put(out[r], i), any = true;
    if (!any) put(out[0], i);  // it sees nothing: all the same to which it belongs
  }
  return out;
}

}  // namespace

CubeBox space_of(const Coverage& coverage) {
  Box3d reach;
  for (const SensorFrustum& frustum : coverage.frusta)
    reach.add(frustum.reach().low), reach.add(frustum.reach().high);
  if (const auto& volume = coverage.scene->volume)
    reach = {max(reach.low, volume->low), min(reach.high, volume->high)};
  const double chunk_m = coverage.scene->fusion.chunk_m;
  const Vec3i high = node::cube_of(reach.high, chunk_m);
  return {node::cube_of(reach.low, chunk_m), high + Vec3i{1, 1, 1}};
}

std::optional<Plan> region_tree(const Coverage& coverage, const PlanConfig& config) {
  std::vector<CubeBox> regions;
  if (!cut_space(coverage, space_of(coverage), config.mergers, regions)) return std::nullopt;
  const std::vector<SensorSet> groups = groups_of(coverage, regions);
  Plan plan;
  plan.split = Split::space;
  MergerIds ids(*coverage.scene);
  MergeLoad sum;
  std::vector<std::string> children;
  for (std::size_t r = 0; r < regions.size(); ++r) {
    const std::vector<SensorSet> inputs = one_by_one(coverage, groups[r]);
    if (inputs.empty()) return std::nullopt;
    PlannedMerger merger;
    merger.config.id = ids.next("region", static_cast<int>(r) + 1);
    merger.config.inputs = sensor_ids(coverage, groups[r]);
    merger.config.deadline_ms = first_deadline_ms(*coverage.scene);
    merger.config.region = regions[r].box(coverage.scene->fusion.chunk_m);
    const MergeLoad load = load_of(coverage, inputs, &regions[r]);
    set_load(merger, load, groups[r], coverage);
    sum.in += load.out, sum.out += load.out;
    children.push_back(merger.config.id);
    plan.mergers.push_back(std::move(merger));
  }
  PlannedMerger root;
  root.layer = 2;
  root.config.id = ids.root, root.config.inputs = children;
  std::vector<const PlannedMerger*> below;
  for (const PlannedMerger& merger : plan.mergers) below.push_back(&merger);
  root.config.deadline_ms = deadline_above_ms(below);
  set_load(root, sum, all_sensors(coverage), coverage);
  plan.mergers.push_back(std::move(root));
  add_latencies(plan, coverage, config);
  return plan;
}

}  // namespace mr::planner
