#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mr/planner/planner.h"

/// Scenes of known sensors, and their plans.
namespace mr::test {

inline constexpr planner::MergeCosts kCosts{.decode_ns = 300,
                                            .merge_ns = 700,
                                            .overlap_ns = 500,
                                            .code_ns = 400,
                                            .memory_bytes = 600,
                                            .coded_bytes = 2};

inline SensorConfig sensor(const std::string& id, Vec3d eye, Vec3d target) {
  SensorConfig out;
  out.id = id;
  out.depth_camera.width = 320, out.depth_camera.height = 288;
  out.depth_camera.fx = out.depth_camera.fy = 210;
  out.depth_camera.cx = 159.5, out.depth_camera.cy = 143.5;
  out.T_world_depth = {look_at(eye, target, {0, 0, 1})};
  out.depth_far_m = 4;
  return out;
}

inline Scene scene_of(std::vector<SensorConfig> sensors) {
  Scene scene;
  scene.id = "plan";
  scene.sensors = std::move(sensors);
  MergerConfig root{.id = "root", .inputs = {}, .deadline_ms = 50};
  for (const SensorConfig& s : scene.sensors) root.inputs.push_back(s.id);
  scene.mergers = {root};
  return scene;
}

/// `count` sensors on a circle that look at its middle.
inline std::vector<SensorConfig> ring(const std::string& name, Vec3d middle, int count) {
  std::vector<SensorConfig> out;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * 3.14159265358979 * i / count;
    out.push_back(sensor(name + std::to_string(i),
                         middle + Vec3d{2.5 * std::cos(angle), 2.5 * std::sin(angle), 0.5},
                         middle));
  }
  return out;
}

inline Result<planner::Plan> plan_of(const Scene& scene, int mergers,
                                     std::optional<planner::Split> split = {}) {
  const std::vector<planner::SensorSample> samples(scene.sensors.size());
  return planner::make_plan(scene, samples, kCosts, {.mergers = mergers, .split = split});
}

}  // namespace mr::test
