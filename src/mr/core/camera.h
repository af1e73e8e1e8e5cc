#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/vec.h"

namespace mr {

enum class CameraModel { pinhole, equirectangular, lidar };
enum class DistortionModel {
  none,
  brown,
  rational,
  rational_6kt,  ///< early Azure Kinects: rational, but the terms with x·y are half as large
};

/// Camera model: the mapping between a sensor's pixels and directions. Camera frame: x right, y
/// down, z forward, metres. Pixel centres lie at integers.
struct Camera {
  CameraModel model = CameraModel::pinhole;
  int width = 0, height = 0;  ///< pixels

  // pinhole
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels
  DistortionModel distortion = DistortionModel::none;
  std::array<double, 6> k{};  ///< radial; Brown uses k1..k3
  std::array<double, 2> p{};  ///< tangential
  double most_radius = 0;  ///< of the plane z = 1, within which the lens model holds; 0: not known

  // lidar: one beam per row
  std::vector<double> beam_altitude_rad;  ///< [height], up is positive
  std::vector<double> beam_azimuth_rad;   ///< [height], offset of the row

  friend bool operator==(const Camera&, const Camera&) = default;

  /// The invalid fields, one line each; empty: usable.
  std::vector<std::string> problems() const;
};

/// Projects a point of the camera frame to pixels; nothing when it has no image (behind a pinhole,
/// outside the range where the distortion is invertible, or at the origin).
/// equirectangular: u = (lon/2π + 0.5) W - 0.5, v = (lat/π + 0.5) H - 0.5 with lon = atan2(x, z),
/// lat positive downwards.
std::optional<Vec2d> project(const Camera& camera, Vec3d point_camera);

/// The viewing direction of a pixel: z = 1 for a pinhole (so depth · direction is the point),
/// unit length for the others (range · direction).
Vec3d unproject(const Camera& camera, Vec2d pixel);

/// The same pinhole without its distortion; other models are returned unchanged.
Camera undistorted(const Camera& camera);

/// A pinhole without distortion, of the same size, whose picture reaches as far as the middles of
/// the camera's edges see: with the focal length kept, a wide lens (Azure Kinect: 75 and 120
/// degrees) would lose its rim. Up to 65 degrees off the axis. Other models are returned unchanged.
Camera undistorted_whole(const Camera& camera);

}  // namespace mr
