#include "mr/core/sensor_config.h"

#include <algorithm>

namespace mr {
namespace {

std::vector<std::string> camera_problems(const SensorConfig& sensor) {
  std::vector<std::string> out = prefixed("depth_camera: ", sensor.depth_camera.problems());
  if (sensor.depth_camera.model == CameraModel::equirectangular)
    out.push_back("depth_camera: only the models pinhole and lidar are supported by this version");
  if (!sensor.color_camera) return out;
  append(out, prefixed("color_camera: ", sensor.color_camera->problems()));
  if (sensor.color_camera->model == CameraModel::lidar)
    out.push_back("color_camera: a lidar takes no colour pictures");
  return out;
}

std::vector<std::string> pose_problems(const SensorConfig& sensor) {
  std::vector<std::string> out;
  const std::size_t poses = sensor.T_world_depth.size(), items = sensor.source.content().items;
  if (poses == 0) out.push_back("T_world_depth must hold a pose");
  if (items > 0 && poses > 1 && poses != items && sensor.trajectory.poses().empty())
    out.push_back("T_world_depth holds " + std::to_string(poses) + " poses for " +
                  std::to_string(items) + " items; it needs one, or one per item");
  if (!std::ranges::all_of(sensor.T_world_depth, is_rigid))
    out.push_back("T_world_depth must hold rigid transforms");
  if (!is_rigid(sensor.T_color_depth)) out.push_back("T_color_depth must be a rigid transform");
  return out;
}

}  // namespace

std::vector<std::string> SensorConfig::problems() const {
  std::vector<std::string> out = prefixed("source: ", source.problems());
  append(out, camera_problems(*this));
  append(out, pose_problems(*this));
  append(out, out_of_range({{"depth_range_m", depth_near_m, kDepth_m},
                            {"depth_range_m", depth_far_m, kDepth_m},
                            {"clock_offset_ms", clock_offset_ms, kClockOffset_ms},
                            {"clock_drift_ppm", clock_drift_ppm, kClockDrift_ppm}}));
  if (depth_near_m >= depth_far_m)
    out.push_back("depth_range_m must be [near, far] with near less than far");
  append(out, prefixed("precision.", precision.problems()));
  return out;
}

Result<Pose> SensorConfig::pose_of(std::size_t item, TimePoint own_time) const {
  if (!trajectory.poses().empty()) return trajectory.at(own_time);
  if (const auto lost = lost_poses.find(item); lost != lost_poses.end()) return lost->second;
  if (T_world_depth.empty()) return Pose{};
  return T_world_depth[T_world_depth.size() == 1 ? 0 : item % T_world_depth.size()];
}

}  // namespace mr
