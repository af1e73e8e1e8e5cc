// LiDAR and equirectangular range pictures of a room with known walls and boxes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "mr/fusion/fuse.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"

namespace mr::fusion {
namespace {

using std::numbers::pi;

/// A room, seen from inside, with solid boxes in it; y points down.
struct Room {
  Box3d walls;
  std::vector<Box3d> boxes;

  double range(Vec3d eye, Vec3d ray) const {
    double best = 1e9;
    for (int i = 0; i < 3; ++i)
      if (ray[i] != 0)
        best = std::min(best, ((ray[i] > 0 ? walls.high : walls.low)[i] - eye[i]) / ray[i]);
    for (const Box3d& box : boxes) {
      double in = 0, out = 1e9;
      for (int i = 0; i < 3; ++i) {
        const double a = (box.low[i] - eye[i]) / ray[i], b = (box.high[i] - eye[i]) / ray[i];
        in = std::max(in, std::min(a, b)), out = std::min(out, std::max(a, b));
      }
      if (in < out && in > 0) best = std::min(best, in);
    }
    return best;
  }

  /// How far a point is from the nearest surface.
  double off(Vec3d p) const {
    double best = 1e9;
    for (int i = 0; i < 3; ++i)
      best = std::min({best, std::abs(p[i] - walls.low[i]), std::abs(p[i] - walls.high[i])});
    for (const Box3d& box : boxes) {
      double inside = -1e9, outside2 = 0;
      for (int i = 0; i < 3; ++i) {
        const double e = std::max(box.low[i] - p[i], p[i] - box.high[i]);
        inside = std::max(inside, e), outside2 += e > 0 ? e * e : 0;
      }
      best = std::min(best, outside2 > 0 ? std::sqrt(outside2) : -inside);
    }
    return best;
  }
};

Room room(double size = 1) {
  const auto box = [&](Vec3d low, Vec3d high) { return Box3d{low * size, high * size}; };
  return {box({-3, -1.2, -2.5}, {3, 1.8, 2.5}),
          {box({0.8, 0.9, -0.5}, {1.6, 1.8, 0.5}), box({-2, -0.2, 0.9}, {-1.7, 1.8, 1.2})}};
}

Pose sensor_pose(double size = 1) {
  return look_at({0.1 * size, 0.05 * size, -0.2 * size}, {size, 0.11 * size, 0.3 * size},
                 {0.05, -1, 0.02});
}

/// Beams from 25 degrees above the horizon to 45 below, rows turned against each other.
Camera lidar(int width, int height) {
  Camera c;
  c.model = CameraModel::lidar, c.width = width, c.height = height;
  for (int i = 0; i < height; ++i) {
    c.beam_altitude_rad.push_back((25 - i * 70.0 / (height - 1)) * pi / 180);
    c.beam_azimuth_rad.push_back(i % 4 * 1.3 * pi / 180);
  }
  return c;
}

Camera equirectangular(int width) {
  Camera c;
  c.model = CameraModel::equirectangular, c.width = width, c.height = width / 2;
  return c;
}

ImageDepth measure(const Room& room, const Camera& camera, const Pose& pose, double noise_m = 0) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  ImageDepth range(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Vec3d ray = pose.rotation * unproject(camera, {double(x), double(y)});
      *range.at(x, y) =
          static_cast<float>(room.range(pose.translation, ray) + noise_m * normal(random));
    }
  return range;
}

Mesh fuse(const ImageDepth& range, const Camera& camera, const Pose& pose, double voxel_m) {
  VolumeConfig config;
  config.voxel_m = voxel_m, config.truncation_m = 4 * voxel_m, config.history = History::none;
  return FrameFuser(config).fuse({range, camera, pose, {0, 0, range.width, range.height}, {}}).mesh;
}

struct Coverage {
  double missed = 0, wrong = 0;  ///< shares of rays that hit nothing, or no surface of the room
};

/// Rays between the beams, but for those near a step in range.
Coverage cover(const Mesh& mesh, const Room& room, const Pose& pose, double low_deg,
               double high_deg, double gap_deg, double tolerance_m) {
  const Mesh* meshes[] = {&mesh};
  const kit::RayScene rays(meshes);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(0, 1);
  const auto ray = [&](double right, double down) {
    return pose.rotation * Vec3d{std::sin(right) * std::cos(down), std::sin(down),
                                 std::cos(right) * std::cos(down)};
  };
  int tried = 0, missed = 0, wrong = 0;
  for (int i = 0; i < 20000; ++i) {
    const double right = (unit(random) * 2 - 1) * pi,
                 down = (low_deg + unit(random) * (high_deg - low_deg)) * pi / 180;
    const double range = room.range(pose.translation, ray(right, down));
    bool at_step = false;
    for (const auto& [a, b] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {0, 2}, {0, -2}}) {
      const double step = 1.3 * gap_deg * pi / 180;
      const double near = room.range(pose.translation, ray(right + a * step, down + b * step));
      at_step |= std::abs(near - range) > 0.3 * range;
    }
    if (at_step) continue;
    ++tried;
    const auto hit = rays.first_hit(vec_cast<float>(pose.translation),
                                    vec_cast<float>(ray(right, down)), 0.01f, 1000);
    missed += !hit;
    wrong +=
        hit && room.off(pose.translation + ray(right, down) * double{hit->distance}) > tolerance_m;
  }
  return {missed / static_cast<double>(tried), wrong / static_cast<double>(tried)};
}

double share_off(const Mesh& mesh, const Room& room, double distance_m) {
  const auto far = std::count_if(mesh.positions.begin(), mesh.positions.end(), [&](Vec3f p) {
    return room.off(vec_cast<double>(p)) > distance_m;
  });
  return static_cast<double>(far) / static_cast<double>(mesh.positions.size());
}

// Rows lie 2 to 7 cm apart on the walls, columns 1 to 2 cm.
TEST(RangePicture, LidarRoomHasNoHolesAndNoBridges) {
  const Camera camera = lidar(1024, 64);
  const Mesh mesh = fuse(measure(room(), camera, sensor_pose()), camera, sensor_pose(), 0.02);
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  const Coverage c = cover(mesh, room(), sensor_pose(), -24, 44, 70.0 / 63, 0.04);
  EXPECT_LT(c.missed, 0.001);
  EXPECT_LT(c.wrong, 0.001);
  EXPECT_LT(share_off(mesh, room(), 0.04), 0.001);
}

// Rows lie up to 30 cm apart, much more on the floor.
TEST(RangePicture, LidarHallHasNoHolesAndNoBridges) {
  const Camera camera = lidar(1024, 64);
  const Pose pose = sensor_pose(4);
  const Mesh mesh = fuse(measure(room(4), camera, pose), camera, pose, 0.05);
  const Coverage c = cover(mesh, room(4), pose, -24, 44, 70.0 / 63, 0.1);
  EXPECT_LT(c.missed, 0.002);
  EXPECT_LT(c.wrong, 0.001);
  EXPECT_LT(share_off(mesh, room(4), 0.1), 0.002);
}

TEST(RangePicture, SparseRowsStillMakeSheets) {
  const Camera camera = lidar(1024, 32);  // 2.3 degrees
  const Mesh mesh = fuse(measure(room(), camera, sensor_pose()), camera, sensor_pose(), 0.02);
  const Coverage c = cover(mesh, room(), sensor_pose(), -24, 44, 70.0 / 31, 0.04);
  EXPECT_LT(c.missed, 0.003);
  EXPECT_LT(c.wrong, 0.005);
}

// Rows lie 12 to 30 cm apart on the walls: of those beside a corner, the plane is that of one wall.
TEST(RangePicture, CornersBetweenSparseRowsStayCorners) {
  const Room empty{room().walls, {}};
  Camera camera = lidar(1024, 32);
  for (int i = 0; i < camera.height; ++i)  // a dome below the ceiling
    camera.beam_altitude_rad[i] = -(i + 0.5) * pi / 2 / camera.height;
  const Pose pose = look_at({0.1, -0.9, -0.2}, {1, -0.9, 0.3}, {0, -1, 0});
  const Mesh mesh = fuse(measure(empty, camera, pose), camera, pose, 0.03);
  const Coverage c = cover(mesh, empty, pose, 2, 85, 90.0 / 32, 0.03);
  EXPECT_LT(c.missed, 0.002);
  EXPECT_LT(c.wrong, 0.0055);  // 0.0067 with the mean of both sides
  EXPECT_LT(share_off(mesh, empty, 0.03), 0.023);
}

TEST(RangePicture, EquirectangularRoomGoesAllAround) {
  const Camera camera = equirectangular(1024);
  const Mesh mesh = fuse(measure(room(), camera, sensor_pose()), camera, sensor_pose(), 0.02);
  const Coverage c = cover(mesh, room(), sensor_pose(), -89, 89, 0.4, 0.04);
  EXPECT_LT(c.missed, 0.004);
  EXPECT_LT(c.wrong, 0.001);
  EXPECT_LT(share_off(mesh, room(), 0.01), 0.002);
}

TEST(RangePicture, NoiseIsNotMadeWorse) {
  const Camera camera = lidar(1024, 128);
  const double noise_m = 0.01;
  const Mesh mesh =
      fuse(measure(room(), camera, sensor_pose(), noise_m), camera, sensor_pose(), 0.02);
  double sum = 0;
  for (const Vec3f p : mesh.positions) sum += std::pow(room().off(vec_cast<double>(p)), 2);
  EXPECT_LT(std::sqrt(sum / static_cast<double>(mesh.positions.size())), noise_m);
}

}  // namespace
}  // namespace mr::fusion
