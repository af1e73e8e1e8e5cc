#include "mr/eval/sensor_coverage.h"

#include <map>
#include <string>

#include "mr/eval/reference.h"
#include "mr/synth/rig_errors.h"

namespace mr::eval {

std::vector<SensorFrustum> sensor_frustums(const Scene& scene) {
  std::map<std::string, Pose> exact;
  if (const RigConfig* rig = known_rig(scene))
    for (const SensorConfig& sensor : synth::exact_sensors(*rig))
      exact[sensor.id] = sensor.T_world_depth.front();
  std::vector<SensorFrustum> frustums;
  for (const SensorConfig& sensor : scene.sensors) {
    const auto known = exact.find(sensor.id);
    frustums.push_back({undistorted_whole(sensor.depth_camera),
                        known != exact.end() ? known->second : sensor.T_world_depth.front(),
                        sensor.depth_near_m, sensor.depth_far_m});
  }
  return frustums;
}

std::vector<HalfSpace> captured_half_spaces(const Scene& scene) {
  std::vector<HalfSpace> out;
  if (scene.volume)
    for (int axis = 0; axis < 3; ++axis) {
      Vec3d along;
      along[axis] = 1;
      out.push_back({along, scene.volume->low[axis]});
      out.push_back({-along, -scene.volume->high[axis]});
    }
  if (scene.floor) out.push_back({scene.up, scene.floor->height_m + scene.floor->margin_m});
  return out;
}

int truth_frame(const Scene& scene, int capture) {
  for (const SensorConfig& sensor : scene.sensors)
    if (const SourceContent content = sensor.source.content(); content.loops && content.items > 0)
      return capture % static_cast<int>(content.items);
  return capture;
}

}  // namespace mr::eval
