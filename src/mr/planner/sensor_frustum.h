#pragma once

#include <array>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/pose.h"
#include "mr/core/sensor_config.h"
#include "mr/core/vec.h"
#include "mr/planner/sensor_sample.h"

namespace mr::planner {

/// The frustum of a sensor's depth camera, from the poses that it takes; with a depth picture of it
/// also what is hidden in there.
class SensorFrustum {
 public:
  /// Keeps a pointer to the sample's picture.
  SensorFrustum(const SensorConfig& sensor, const SensorSample& sample);

  /// Whether a point lies in the frustum and, where there is a picture, on a surface in it.
  bool sees(Vec3d point) const;
  /// Points spread evenly over the frustum's volume, always the same.
  std::vector<Vec3d> points(int count) const;
  /// All that it can see lies in here.
  Box3d reach() const;
  /// Whether it can see something of a box; may be true of one that is just beside its frustum.
  bool may_see(const Box3d& box) const;

 private:
  bool is_flat() const { return camera_.model == CameraModel::pinhole; }
  std::array<Vec2d, 8> border() const;
  bool has_surface(int u, int v, double depth_m) const;
  bool is_beside(const Box3d& box, const Pose& T_depth_world) const;

  Camera camera_;
  const ImageDepth* depth_;
  double near_m_, far_m_, farthest_m_ = 0;
  Box3d rays_;  // of a pinhole's border, at 1 m
  std::vector<Pose> T_world_depth_;
  std::vector<Pose> seen_from_;  // T_depth_world
};

}  // namespace mr::planner
