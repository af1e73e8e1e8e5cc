#include "mr/planner/sensor_sample.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "mr/core/trace.h"
#include "mr/node/sensor_node.h"
#include "mr/node/sources.h"

namespace mr::planner {
namespace {

/// Points that stand for all triangles.
std::vector<Vec3f> some_points(const Mesh& mesh) {
  constexpr std::size_t kMost = 2048;
  const std::size_t count = std::min(mesh.triangles.size(), kMost);
  std::vector<Vec3f> out;
  for (std::size_t i = 0; i < count; ++i)
    out.push_back(mesh.centroid(i * mesh.triangles.size() / count));
  return out;
}

Result<SensorSample> sample_of(const Scene& scene, SensorId sensor, FrameSource& source) {
  auto frame = source.next();
  if (!frame) return frame.error();
  if (!*frame) return Error{Error::Cause::empty, "its source has no frame"};
  node::SensorNode node(scene, sensor);
  SensorSample out;
  std::optional<node::SensorNode::Reconstructed> made;
  {
    const Stopwatch stopwatch(out.reconstruct_ms);
    auto reconstructed = node.reconstruct(**std::move(frame));
    if (!reconstructed) return reconstructed.error();
    made = *std::move(reconstructed);
  }
  out.triangles = static_cast<double>(made->mesh.triangles.size());
  out.area_m2 = surface_area_m2(made->mesh);
  out.surface = some_points(made->mesh);
  out.T_world_depth = made->frame.T_world_depth;
  out.depth = std::move(made->frame.depth);
  return out;
}

/// The estimate for sensors that were not sampled.
SensorSample mean_of(std::span<const SensorSample> looked) {
  SensorSample out;
  if (looked.empty()) return out;
  out.triangles = 0;
  const double n = static_cast<double>(looked.size());
  for (const SensorSample& sample : looked) {
    out.triangles += sample.triangles / n, out.area_m2 += sample.area_m2 / n;
    out.reconstruct_ms += sample.reconstruct_ms / n;
  }
  return out;
}

}  // namespace

std::vector<SensorSample> sample_sensors(const Scene& scene, const std::filesystem::path& rig_cache,
                                         const SampleConfig& config) {
  const std::size_t n = scene.sensors.size();
  const bool all = n <= static_cast<std::size_t>(config.most_sensors);
  const std::size_t count = all ? n : std::min<std::size_t>(n, SampleConfig::kSamples);
  std::vector<SensorId> wanted;
  for (std::size_t i = 0; i < count; ++i) wanted.push_back(sensor_at(i * n / count));
  const auto sources = node::open_sources(scene, wanted, rig_cache);
  std::vector<SensorSample> out(n), looked;
  for (std::size_t i = 0; i < count; ++i) {
    if (config.progress) config.progress(i, count);
    auto sample = sample_of(scene, wanted[i], *sources[i]);
    if (!sample && config.notice)
      config.notice("sensor '" + scene.sensor(wanted[i]).id +
                    "' is taken for usual: " + sample.error().message);
    if (!sample) continue;
    if (all)
      out[i] = *std::move(sample);
    else
      looked.push_back(*std::move(sample));
  }
  if (!all) std::fill(out.begin(), out.end(), mean_of(looked));
  return out;
}

}  // namespace mr::planner
