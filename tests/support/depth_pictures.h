#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/pose.h"

/// Depth pictures of simple solids, by formula. Those of a pinhole take nothing but + - * / and
/// square roots: the same bytes on every machine.
namespace mr::test {

struct Ball {
  Vec3d center;
  double radius_m = 1;
};

/// The shapes in front of a sensor.
struct Solids {
  std::optional<Box3d> room;  ///< seen from inside
  std::vector<Box3d> boxes;
  std::vector<Ball> balls;
};

/// How far along `ray` it enters and leaves a box, in lengths of `ray`; first > second: never.
struct Crossing {
  double first = -std::numeric_limits<double>::max(), second = std::numeric_limits<double>::max();
};
inline Crossing crossing(const Box3d& box, Vec3d eye, Vec3d ray) {
  Crossing c;
  for (int axis = 0; axis < 3; ++axis) {
    if (ray[axis] == 0) {
      if (eye[axis] < box.low[axis] || eye[axis] > box.high[axis]) return {1, 0};
      continue;
    }
    const double a = (box.low[axis] - eye[axis]) / ray[axis];
    const double b = (box.high[axis] - eye[axis]) / ray[axis];
    c.first = std::max(c.first, std::min(a, b)), c.second = std::min(c.second, std::max(a, b));
  }
  return c;
}

/// The first surface along a ray, in lengths of `ray`; 0: none.
inline double first_hit(const Solids& solids, Vec3d eye, Vec3d ray) {
  double nearest = std::numeric_limits<double>::max();
  const auto meet = [&](double at) {
    if (at > 0) nearest = std::min(nearest, at);
  };
  if (solids.room) meet(crossing(*solids.room, eye, ray).second);
  for (const Box3d& box : solids.boxes) {
    const Crossing c = crossing(box, eye, ray);
    if (c.first <= c.second) meet(c.first);
  }
  for (const Ball& ball : solids.balls) {
    const Vec3d off = eye - ball.center;
    const double a = dot(ray, ray), b = dot(off, ray),
                 c = dot(off, off) - ball.radius_m * ball.radius_m;
    if (b * b >= a * c) meet((-b - std::sqrt(b * b - a * c)) / a);
  }
  return nearest < std::numeric_limits<double>::max() ? nearest : 0;
}

/// What an exact sensor measures: depth of a pinhole, range of other models; 0 where nothing is.
inline ImageDepth depth_picture(const Solids& solids, const Camera& camera,
                                const Pose& T_world_camera) {
  ImageDepth depth(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Vec3d ray = unproject(camera, {static_cast<double>(x), static_cast<double>(y)});
      *depth.at(x, y) = static_cast<float>(
          first_hit(solids, T_world_camera.translation, T_world_camera.rotation * ray));
    }
  return depth;
}

/// Whole numbers in no order, the same everywhere (splitmix64, Steele et al. 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint32_t operator()() {
    std::uint64_t v = state_ += 0x9E3779B97F4A7C15ull;
    v = (v ^ v >> 30) * 0xBF58476D1CE4E5B9ull;
    v = (v ^ v >> 27) * 0x94D049BB133111EBull;
    return static_cast<std::uint32_t>((v ^ v >> 31) >> 32);
  }
  /// In [low, high).
  double between(double low, double high) {
    return low + (high - low) * ((*this)() / 4294967296.0);
  }

 private:
  std::uint64_t state_;
};

/// Moves every measurement by up to ± noise_m, all steps equally likely.
inline ImageDepth with_noise(ImageDepth depth, double noise_m, std::uint64_t seed) {
  Random random(seed);
  for (float& d : depth.data) {
    const double moved = d + random.between(-noise_m, noise_m);
    if (d > 0) d = static_cast<float>(moved);
  }
  return depth;
}

/// Depths that have nothing to do with each other; one in eight pixels measured nothing.
inline ImageDepth random_depth(int width, int height, double low_m, double high_m,
                               std::uint64_t seed) {
  Random random(seed);
  ImageDepth depth(width, height);
  for (float& d : depth.data) {
    const bool measured = random() % 8 != 0;
    const double value = random.between(low_m, high_m);
    if (measured) d = static_cast<float>(value);
  }
  return depth;
}

inline Camera pinhole(int width, int height, double focal_px) {
  Camera c;
  c.width = width, c.height = height, c.fx = c.fy = focal_px;
  c.cx = (width - 1) / 2.0, c.cy = (height - 1) / 2.0;
  return c;
}

inline Camera panorama(int width, int height) {
  Camera c;
  c.model = CameraModel::equirectangular, c.width = width, c.height = height;
  return c;
}

/// Beams evenly between two angles; every other row starts half a column later.
inline Camera lidar(int columns, int beams, double up_deg, double down_deg) {
  constexpr double kDegree = std::numbers::pi / 180;
  Camera c;
  c.model = CameraModel::lidar, c.width = columns, c.height = beams;
  for (int y = 0; y < beams; ++y) {
    const double share = beams > 1 ? static_cast<double>(y) / (beams - 1) : 0;
    c.beam_altitude_rad.push_back((up_deg - (up_deg + down_deg) * share) * kDegree);
    c.beam_azimuth_rad.push_back(y % 2 * std::numbers::pi / columns);
  }
  return c;
}

inline Rect whole(const ImageDepth& depth) { return {0, 0, depth.width, depth.height}; }

/// Rotated against the voxel grid, as a real camera is.
inline Pose tilted_pose(Vec3d eye = {0.13, -0.21, 0.07}) {
  return look_at(eye, eye + Vec3d{0.37, 0.51, 1.93}, {0.1, -1, 0});
}

/// A room of 3 m with two boxes and a ball in it.
inline Solids furnished_room() {
  return {Box3d{{-1.53, -1.27, -1.48}, {1.61, 1.33, 2.57}},
          {Box3d{{0.21, 0.37, 1.13}, {0.74, 1.33, 1.66}},
           Box3d{{-0.83, 0.11, 1.51}, {-0.22, 0.63, 2.02}}},
          {Ball{{0.15, -0.13, 1.43}, 0.31}}};
}

}  // namespace mr::test
