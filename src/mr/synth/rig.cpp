#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "mr/synth/floor_plan.h"
#include "mr/synth/furniture.h"
#include "mr/synth/hash.h"
#include "mr/synth/rig_errors.h"
#include "mr/synth/room.h"

namespace mr::synth {
namespace {

constexpr int kMostAround = 16;    // cameras that stand around a room; more hang from a grid
constexpr double kClear_m = 0.12;  // around a camera
constexpr double kRadians = std::numbers::pi / 180;

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
  const double a = -6 * kRadians, c = std::cos(a), s = std::sin(a);
  return {{{1, 0, 0, 0, c, -s, 0, s, c}}, {-0.032, 0.002, 0.004}};
}

/// Where a camera is and what it looks at; room frame.
struct CameraPlacement {
  Vec3d eye, target;
};

/// The free place nearest to a wanted one, searched in rings at the same height, then lower.
Vec3d nearest_free(const FloorPlan& plan, Vec3d wanted) {
  constexpr double kStep = 0.1;
  for (double drop = 0; drop < 1; drop += 0.25)
    for (int ring = 0; ring < 20; ++ring) {
      const int sides = std::max(1, 8 * ring);
      for (int i = 0; i < sides; ++i) {
        const double a = 2 * std::numbers::pi * i / sides;
        const Vec3d p =
            wanted + Vec3d{ring * kStep * std::cos(a), ring * kStep * std::sin(a), -drop};
        if (plan.clearance_m(p) >= kClear_m) return p;
      }
    }
  return wanted;
}

/// Camera `i` of `n` on a rectangle near the walls: four stand in the corners, eight in the
/// middles of the walls as well.
CameraPlacement around(const RigConfig& rig, const FloorPlan& plan, int i, int n) {
  const double inset = 0.3, w = rig.room_m.x / 2 - inset, d = rig.room_m.y / 2 - inset;
  const Vec2d corners[] = {{-w, -d}, {w, -d}, {w, d}, {-w, d}, {-w, -d}};
  const double along = 4.0 * i / n;
  const int side = static_cast<int>(along);
  const Vec2d p = corners[side] + (corners[side + 1] - corners[side]) * (along - side);
  const double top = std::min(2.0, rig.room_m.z - 0.3), low = std::min(1.65, top);
  const double height = low + (top - low) * unit(mix(rig.seed, 1000 + i));
  const Vec3d eye = nearest_free(plan, {p.x, p.y, height});
  return {eye, {0.1 * eye.x, 0.1 * eye.y, std::min(0.75, rig.room_m.z * 0.3)}};
}

/// A target some 2.5 m away: the way that comes nearest to `azimuth` and is free.
Vec3d free_target(const FloorPlan& plan, Vec3d eye, double azimuth) {
  constexpr int kWays = 12;
  constexpr double kAtWall_m = 0.5;
  Vec3d best;
  double least = 1e9;
  for (int i = 0; i < kWays; ++i) {
    const double off = (i % 2 == 0 ? 1 : -1) * ((i + 1) / 2) * 2 * std::numbers::pi / kWays;
    const double a = azimuth + off, height = std::min(0.9, 0.4 * eye.z);
    const double reach = std::min(2.0, 2.5 * plan.height_m());
    const Vec3d target{eye.x + reach * std::cos(a), eye.y + reach * std::sin(a), height};
    const double outside = std::max({std::abs(target.x) - plan.half_width_m() + kAtWall_m,
                                     std::abs(target.y) - plan.half_depth_m() + kAtWall_m, 0.0});
    const double cost = std::abs(off) + 4 * outside + (plan.sees(eye, target) ? 0 : 1.5);
    if (cost < least) least = cost, best = target;
  }
  return best;
}

/// Camera `i` of `n` below the ceiling, in a grid of about square cells.
CameraPlacement in_grid(const RigConfig& rig, const FloorPlan& plan, int i, int n) {
  const double w = rig.room_m.x, d = rig.room_m.y;
  const int nx = std::clamp(static_cast<int>(std::lround(std::sqrt(n * w / d))), 1, n);
  const int ny = (n + nx - 1) / nx;
  const int ix = i % nx, iy = i / nx;
  const int in_row = std::min(nx, n - iy * nx);  // the last row may hold fewer
  Vec3d p{((ix + 0.5) / in_row - 0.5) * w, ((iy + 0.5) / ny - 0.5) * d,
          std::clamp(rig.room_m.z - 0.3, 0.6, 2.5)};
  // In a corridor left and right take turns.
  const double aside = (i % 2 == 0 ? 0.25 : -0.25);
  if (nx == 1) p.x += aside * w;
  if (ny == 1) p.y += aside * d;
  const double quarter = std::numbers::pi / 2 * ((ix + 2 * iy + (ny == 1 ? ix : 0)) % 4);
  const double azimuth = (nx == 1 ? std::numbers::pi / 2 + 2 * quarter : quarter) +
                         0.5 * (unit(mix(rig.seed, 1000 + i)) - 0.5);
  const Vec3d eye = nearest_free(plan, p);
  return {eye, free_target(plan, eye, azimuth)};
}

SensorConfig kinect(const RigConfig& rig, const FloorPlan& plan, int i) {
  const bool grid = rig.sensors > kMostAround || rig.kind == RigConfig::Kind::corridor;
  const CameraPlacement stand =
      grid ? in_grid(rig, plan, i, rig.sensors) : around(rig, plan, i, rig.sensors);
  SensorConfig sensor;
  sensor.depth_camera = depth_camera(rig);
  sensor.color_camera = color_camera(rig);
  sensor.T_color_depth = color_from_depth();
  sensor.T_world_depth = {room_pose() * look_at(stand.eye, stand.target, {0, 0, 1})};
  sensor.depth_near_m = 0.3;
  sensor.depth_far_m = 6.0;
  return sensor;
}

/// The share of the floor, in steps of a twelfth of the room, that is seen from a place.
double floor_seen(const FloorPlan& plan, Vec3d eye) {
  constexpr int kSteps = 12;
  constexpr double kAbove_m = 0.1;
  int seen = 0;
  for (int j = 1; j < kSteps; ++j)
    for (int i = 1; i < kSteps; ++i)
      seen += plan.sees(eye, {(2.0 * i / kSteps - 1) * plan.half_width_m(),
                              (2.0 * j / kSteps - 1) * plan.half_depth_m(), kAbove_m});
  return seen / static_cast<double>((kSteps - 1) * (kSteps - 1));
}

/// A free place near a wanted one, farther away only where much more of the floor is seen: not
/// beside a lamp that hangs in the way.
Vec3d open_place(const FloorPlan& plan, Vec3d wanted) {
  constexpr int kReach = 2;
  constexpr double kStep_m = 0.4, kCostPer_m = 0.04;
  Vec3d best = wanted;
  double most = -1e9;
  for (int j = -kReach; j <= kReach; ++j)
    for (int i = -kReach; i <= kReach; ++i) {
      const Vec3d eye = nearest_free(plan, wanted + Vec3d{i * kStep_m, j * kStep_m, 0});
      const double worth = floor_seen(plan, eye) - kCostPer_m * length(eye - wanted);
      if (worth > most) most = worth, best = eye;
    }
  return best;
}

/// A hemispherical LiDAR that hangs upside down, like an OS-Dome: its beams go from the horizon
/// straight down.
SensorConfig lidar(const RigConfig& rig, const FloorPlan& plan, int i) {
  constexpr int kColumns = 2048, kPanorama = 2048;
  SensorConfig sensor;
  Camera& beams = sensor.depth_camera;
  beams.model = CameraModel::lidar;
  beams.width = kColumns, beams.height = rig.lidar_beams;
  for (int row = 0; row < rig.lidar_beams; ++row)
    beams.beam_altitude_rad.push_back(-(row + 0.5) * 90 / rig.lidar_beams * kRadians);
  beams.beam_azimuth_rad.assign(rig.lidar_beams, 0);
  Camera panorama;
  panorama.model = CameraModel::equirectangular;
  panorama.width = kPanorama, panorama.height = kPanorama / 2;
  sensor.color_camera = panorama;
  sensor.T_color_depth.translation = {0, 0.06, 0};  // the camera sits above the LiDAR
  const bool along_x = rig.room_m.x >= rig.room_m.y;
  const double place = ((i + 0.5) / rig.lidars - 0.5) * (along_x ? rig.room_m.x : rig.room_m.y);
  const Vec3d wanted{along_x ? place : 0, along_x ? 0 : place, rig.room_m.z - 0.3};
  const Vec3d eye = open_place(plan, wanted);
  sensor.T_world_depth = {room_pose() * look_at(eye, eye + Vec3d{1, 0, 0}, {0, 0, 1})};
  sensor.depth_near_m = 0.3;
  sensor.depth_far_m = 20;
  sensor.precision = {.base_m = rig.lidar_noise_mm / 1000, .per_m2 = 0};
  return sensor;
}

}  // namespace

std::vector<SensorConfig> exact_sensors(const RigConfig& rig) {
  const FloorPlan plan(rig, build_room(rig).blocks);
  const std::vector<std::string> ids = rig.sensor_ids();
  std::vector<SensorConfig> sensors;
  for (int i = 0; i < static_cast<int>(ids.size()); ++i) {
    sensors.push_back(i < rig.sensors ? kinect(rig, plan, i) : lidar(rig, plan, i - rig.sensors));
    sensors.back().id = ids[i];
    sensors.back().source = SyntheticSource{static_cast<std::uint32_t>(i)};
  }
  return sensors;
}

std::vector<SensorConfig> rig_sensors(const RigConfig& rig) {
  std::vector<SensorConfig> sensors = exact_sensors(rig);
  for (std::uint32_t i = 0; i < sensors.size(); ++i)
    for (Pose& pose : sensors[i].T_world_depth) pose = pose * calibration_error(rig, i);
  return sensors;
}

}  // namespace mr::synth
