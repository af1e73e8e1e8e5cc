#include "mr/planner/latency_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "mr/node/chunk_grid.h"

namespace mr::planner {
namespace {

/// Time for a node's bytes over a link that the scene names.
double link_ms(const Coverage& coverage, const std::string& from, double triangles,
               double base_ms) {
  double out = base_ms;
  for (const LinkConfig& link : coverage.scene->links)
    if (link.from == from && link.limit_mbps > 0)
      out = std::max(
          out, base_ms + triangles * coverage.costs->coded_bytes * 8 / (link.limit_mbps * 1000));
  return out;
}

}  // namespace

MergeLoad load_of(const Coverage& coverage, std::span<const SensorSet> inputs,
                  const CubeBox* region) {
  SensorSet all = coverage.none();
  std::vector<std::size_t> input_of(coverage.sensors());
  for (std::size_t k = 0; k < inputs.size(); ++k)
    for (std::size_t i = 0; i < coverage.sensors(); ++i)
      if (has(inputs[k], i)) put(all, i), input_of[i] = k;
  MergeLoad out;
  for (const SurfacePoint& point : coverage.points) {
    if (!has(all, point.sensor)) continue;
    const Vec3i cube = node::cube_of(point.at, coverage.scene->fusion.chunk_m);
    if (region && !holds(*region, cube, 1)) continue;
    const int among = common(point.seen, all);
    const int inside = common(point.seen, inputs[input_of[point.sensor]]);
    out.in += point.triangles / inside;
    if (among > inside) out.shared += point.triangles / inside;
    if (!region || holds(*region, cube, 0)) out.out += point.triangles / among;
  }
  return out;
}

void set_load(PlannedMerger& merger, const MergeLoad& load, const SensorSet& group,
              const Coverage& coverage) {
  constexpr double kBytesPerPixel = 12;  // a picture, the one before it, and the decoder's
  const MergeCosts& costs = *coverage.costs;
  merger.triangles_in = load.in, merger.triangles_out = load.out;
  merger.triangles_shared = load.shared;
  merger.latency_ms = 1e-6 * (load.in * (costs.decode_ns + costs.merge_ns) +
                              load.shared * costs.overlap_ns + load.out * costs.code_ns);
  double pixels = 0;
  for (std::size_t i = 0; i < coverage.sensors(); ++i)
    if (const auto& camera = coverage.scene->sensors[i].color_camera; camera && has(group, i))
      pixels += static_cast<double>(camera->width) * camera->height;
  merger.memory_mb = 1e-6 * (load.in * costs.memory_bytes + pixels * kBytesPerPixel);
}

void add_latencies(Plan& plan, const Coverage& coverage, const PlanConfig& config) {
  std::map<std::string, double> sent;  // triangles
  for (std::size_t i = 0; i < coverage.sensors(); ++i)
    sent[coverage.scene->sensors[i].id] = coverage.triangles[i];
  std::map<int, std::pair<double, double>> layers;  // slowest merger and link
  for (const PlannedMerger& merger : plan.mergers) {
    auto& [slowest, link] = layers[merger.layer];
    slowest = std::max(slowest, merger.latency_ms);
    for (const std::string& input : merger.config.inputs)
      link = std::max(link, link_ms(coverage, input, sent[input], config.link_ms));
    sent[merger.config.id] = merger.triangles_out;
  }
  plan.layers = static_cast<int>(layers.size());
  plan.latency_ms = plan.links_ms = 0;
  for (const auto& [layer, ms] : layers)
    plan.latency_ms += ms.first + ms.second, plan.links_ms += ms.second;
}

double first_deadline_ms(const Scene& scene) {
  double out = scene.mergers.front().deadline_ms;
  for (const MergerConfig& merger : scene.mergers) out = std::min(out, merger.deadline_ms);
  return out;
}

double deadline_above_ms(std::span<const PlannedMerger* const> inputs) {
  double deadline = 0, slowest = 0, fastest = 1e9;
  for (const PlannedMerger* input : inputs) {
    deadline = std::max(deadline, input->config.deadline_ms);
    slowest = std::max(slowest, input->latency_ms), fastest = std::min(fastest, input->latency_ms);
  }
  return deadline + 10 * std::ceil((slowest - fastest) / 10);
}

}  // namespace mr::planner
