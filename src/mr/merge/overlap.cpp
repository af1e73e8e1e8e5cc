#include "mr/merge/overlap.h"

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/merge/ownership.h"
#include "mr/merge/paper_rule.h"

namespace mr::merge {
namespace {

/// A part's mesh, each triangle with the sensor that measured it as its view.
Mesh by_sensor(const Part& part) {
  Mesh out = part.mesh;
  if (part.sources.size() == 1)
    set_triangle_views(out, std::vector(out.triangles.size(), part.sources[0].sensor));
  return out;
}

/// What is left by the paper's rule.
std::vector<Mesh> nearest(std::span<const Part> parts, const OverlapConfig& config) {
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

}  // namespace

std::vector<Mesh> remove_overlap(std::span<const Part> parts, const OverlapConfig& config,
                                 QualityMemory* memory) {
  for (const Part& part : parts) MR_ASSERT(!part.sources.empty());
  if (parts.size() == 1) return {by_sensor(parts[0])};
  return config.owner == MergeConfig::Owner::paper ? nearest(parts, config)
                                                   : best_measured(parts, config, memory);
}

}  // namespace mr::merge
