#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "mr/synth/furniture.h"
#include "mr/synth/hash.h"
#include "mr/synth/room.h"

namespace mr::synth {
namespace {

Camera pinhole(int width, int height, double focal_px) {
  Camera camera;
  camera.width = width, camera.height = height;
  camera.fx = camera.fy = focal_px;
  camera.cx = width / 2, camera.cy = height / 2;
  return camera;
}

/// The narrow mode of an Azure Kinect, or for square pictures its wide one.
Camera depth_camera(const RigConfig& rig) {
  const bool wide = rig.depth_width == rig.depth_height;
  const double focal = wide ? 252.0 * rig.depth_width / 512 : 504.0 * rig.depth_width / 640;
  return pinhole(rig.depth_width, rig.depth_height, focal);
}

Camera color_camera(const RigConfig& rig) {
  return pinhole(rig.color_width, rig.color_height, 612.0 * rig.color_width / 1280);
}

/// As on the device: the depth camera looks 6 degrees further down and sits 32 mm to the side.
Pose color_from_depth() {
  const double a = -6 * std::numbers::pi / 180, c = std::cos(a), s = std::sin(a);
  return {{{1, 0, 0, 0, c, -s, 0, s, c}}, {-0.032, 0.002, 0.004}};
}

/// Camera `i` of `n` on a rectangle near the walls: four stand in the corners, eight in the
/// middles of the walls as well. Room frame.
Vec3d stand(const RigConfig& rig, int i, int n) {
  const double inset = 0.3, w = rig.room_m.x / 2 - inset, d = rig.room_m.y / 2 - inset;
  const Vec2d corners[] = {{-w, -d}, {w, -d}, {w, d}, {-w, d}, {-w, -d}};
  const double along = 4.0 * i / n;
  const int side = static_cast<int>(along);
  const Vec2d p = corners[side] + (corners[side + 1] - corners[side]) * (along - side);
  const double top = std::min(2.0, rig.room_m.z - 0.3), low = std::min(1.65, top);
  return {p.x, p.y, low + (top - low) * unit(mix(rig.seed, 1000 + i))};
}

}  // namespace

std::vector<SensorConfig> rig_sensors(const RigConfig& rig) {
  const Pose T_world_room = room_pose();
  const int n = std::clamp(rig.sensors, 1, 16);
  std::vector<SensorConfig> sensors(n);
  for (int i = 0; i < n; ++i) {
    SensorConfig& sensor = sensors[i];
    sensor.id = "cam-" + std::to_string(i);
    sensor.source = SyntheticSource{static_cast<std::uint32_t>(i)};
    sensor.depth_camera = depth_camera(rig);
    sensor.color_camera = color_camera(rig);
    sensor.T_color_depth = color_from_depth();
    const Vec3d eye = stand(rig, i, n);
    const Vec3d target{0.1 * eye.x, 0.1 * eye.y, std::min(0.75, rig.room_m.z * 0.3)};
    sensor.T_world_depth = {T_world_room * look_at(eye, target, {0, 0, 1})};
    sensor.depth_near_m = 0.3;
    sensor.depth_far_m = 6.0;
  }
  return sensors;
}

}  // namespace mr::synth
