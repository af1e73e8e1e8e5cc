#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/sensor_config.h"
#include "mr/core/view.h"

namespace mr::sensor {

/// Removes lens distortion from both pictures of a sensor and relates them: after it, both cameras
/// are ideal pinholes (or equirectangular) and the colour camera's pose is known. Colour is not
/// resampled into depth pixels: triangles are textured by projection into the colour view.
class Registration {
 public:
  explicit Registration(const SensorConfig& sensor, SensorId id);

  /// Depth by nearest pixel (never mixing foreground with background), colour bilinear; pixels
  /// that the original picture does not cover become 0 / black. Pictures without distortion pass
  /// through untouched.
  Frame undistort(Frame frame) const;

  const Camera& depth_camera() const { return depth_camera_; }  ///< after undistortion

  /// The colour camera as a view; image_rect and atlas_rect are the part of the undistorted picture
  /// that the original covers, so no client sees the black rim. Nothing when
  /// the sensor has no colour. Stream and layout are left 0.
  std::optional<View> color_view(const Pose& T_world_depth) const;

 private:
  SensorId id_;
  Camera depth_camera_;
  std::optional<Camera> color_camera_;
  Pose T_depth_color_;
  std::vector<std::int32_t>
      depth_map_;    ///< [H*W] source pixel per undistorted pixel, -1 none; empty: identity
  Rect color_rect_;  ///< part of the undistorted colour picture that the original covers
  std::vector<Vec2f> color_map_;  ///< [H*W] source position per undistorted pixel; empty: identity
};

}  // namespace mr::sensor
