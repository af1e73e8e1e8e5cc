#include "mr/merge/overlap/overlap.h"

#include <algorithm>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/merge/groups.h"
#include "mr/merge/overlap/measured.h"
#include "mr/merge/overlap/occlusion_rule.h"
#include "mr/merge/overlap/ownership.h"

namespace mr::merge {
namespace {

constexpr double kLeastReach_voxels = 5;  // of parts that meet: coarse cells are fewer

/// A part's mesh, each triangle with the sensor that measured it.
Mesh by_sensor(const kit::Part& part) {
  Mesh out = part.mesh;
  if (part.sources.size() == 1) set_sensor(out, part.sources[0].sensor);
  return out;
}

/// The remaining meshes by the paper's rule.
std::vector<Mesh> nearest(std::span<const kit::Part> parts, const OverlapConfig& config) {
  const auto goes = farther_triangles(parts, config);
  std::vector<Mesh> out(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      std::vector<std::uint8_t> keep(goes[i].size());
      for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = goes[i][t] == 0;
      out[i] = select_triangles(by_sensor(parts[i]), keep);
    }
  });
  return out;
}

/// Whether a sensor is a source of several parts.
bool share_sensors(std::span<const kit::Part> parts) {
  std::vector<SensorId> sensors;
  for (const kit::Part& part : parts)
    for (const SourceInfo& source : part.sources) sensors.push_back(source.sensor);
  std::ranges::sort(sensors);
  return std::ranges::adjacent_find(sensors) != sensors.end();
}

/// The remaining meshes by coherent ownership. Groups of parts that are apart are independent.
std::vector<Mesh> best(std::span<const kit::Part> parts, const OverlapConfig& config,
                       QualityMemory* memory) {
  std::vector<const Mesh*> meshes;
  for (const kit::Part& part : parts) meshes.push_back(&part.mesh);
  const double reach_m =
      std::max(farthest_alike_m(parts, config), kLeastReach_voxels * config.voxel_m);
  const auto groups = connected_groups(meshes, reach_m);
  if (groups.size() == 1) return best_measured(parts, config, memory);
  std::vector<Mesh> out(parts.size());
  const auto work = [&](const std::vector<std::uint32_t>& group) {
    if (group.size() == 1) {
      out[group[0]] = by_sensor(parts[group[0]]);
      return;
    }
    std::vector<kit::Part> some;
    for (const std::uint32_t i : group) some.push_back(parts[i]);
    std::vector<Mesh> owned = best_measured(some, config, memory);
    for (std::size_t k = 0; k < group.size(); ++k) out[group[k]] = std::move(owned[k]);
  };
  // QualityMemory is by sensor: groups with a common sensor must run one after another.
  const std::size_t grain = memory && share_sensors(parts) ? groups.size() : 1;
  parallel_for(groups.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) work(groups[g]);
  });
  return out;
}

}  // namespace

std::vector<Mesh> remove_overlap(std::span<const kit::Part> parts, const OverlapConfig& config,
                                 QualityMemory* memory) {
  for (const kit::Part& part : parts) MR_ASSERT(!part.sources.empty());
  if (parts.size() == 1) return {by_sensor(parts[0])};
  return config.owner == MergeConfig::Owner::paper ? nearest(parts, config)
                                                   : best(parts, config, memory);
}

}  // namespace mr::merge
