#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/core/vec.h"

namespace mr::fusion {

struct VolumeConfig;

/// A depth picture with its camera, pose and precision: the input of fusion. Holds references,
/// which must outlive the call.
struct DepthFrame {
  const ImageDepth& depth;
  const Camera& camera;  ///< undistorted pinhole, equirectangular or LiDAR
  const Pose& T_world_camera;
  Rect region;                         ///< pixels outside are ignored
  std::optional<Precision> precision;  ///< weights by 1 / variance; none: all weights are equal
  /// Samples a pinhole's depth by a plane per pixel (pinhole_planes) instead of the nearest pixel,
  /// whose steps roughen slanted walls and tear grazing surfaces. Slower.
  bool slanted = false;
};

/// The tangent plane of a pixel in a range picture: inverse range, its derivatives per radian to
/// the right and downwards, and the cosine that turns distance along the ray into distance to the
/// plane. With DepthFrame::slanted, for a pinhole: inverse depth and its derivatives per pixel; off
/// the axis a step in depth is longer along the ray, so `cosine` may exceed 1.
struct RangePlane {
  float inverse = 0, right = 0, down = 0, cosine = 1;
};

/// A depth picture, or a rectangle of it, in the layout of the SIMD kernels: valid pixels, a border
/// of invalid ones, and the coefficients of projection (voxel → pixel) and unprojection (pixel →
/// point). Reused from frame to frame to save allocations.
struct FrameView {
  static constexpr float kNothing = -1e30f;  ///< invalid depth: far behind every voxel's band
  static constexpr int kPadding = 16;        ///< floats that a row may be read past its end

  int width = 0, height = 0;  ///< of the rectangle
  int stride = 0;             ///< floats from row to row
  /// [(height + 2) · stride] depth or range, or kNothing; pixel (x, y) is at place(x, y).
  std::vector<float> depth;
  std::size_t place(int x, int y) const { return static_cast<std::size_t>(y + 1) * stride + x + 1; }
  const float* row(int y) const { return depth.data() + place(0, y); }
  float* row(int y) { return depth.data() + place(0, y); }

  // Pixel → point, in blocks from the corner of eye_block:
  // eye + depth · (ray[y][0] + s[x] · ray[y][1] + t[x] · ray[y][2]).
  Vec3i eye_block;
  Vec3f eye;
  std::vector<float> s, t;                ///< [width + kPadding]
  std::vector<std::array<Vec3f, 3>> ray;  ///< [height]
  std::optional<Box3f> bounds;            ///< in blocks from the corner of eye_block
  Vec3f direction(int x, int y) const { return ray[y][0] + ray[y][1] * s[x] + ray[y][2] * t[x]; }

  // Voxel → pixel: (U, V, Z) = origin + x · axis[0] + y · axis[1] + z · axis[2]. Pinhole: the index
  // in `depth` is (U / Z, V / Z), rounded, and the depth is Z. Others: (U, V, Z) is the point in
  // the camera frame, metres.
  Vec3d origin;                      ///< (U, V, Z) of the world's origin
  std::array<Vec3d, 3> axis;         ///< change of (U, V, Z) per voxel along x, y, z
  std::array<float, 64> dU, dV, dZ;  ///< from a layer's first voxel to each of its 64

  // Pinhole only: change of the direction of depth 1 per pixel to the right and downwards, in the
  // camera frame, and downwards in blocks; the direction's y of the first row.
  Vec2f per_pixel;
  Vec3f down_per_pixel;
  float first_row = 0;

  bool slanted = false;            ///< DepthFrame::slanted; never of range pictures
  std::vector<RangePlane> planes;  ///< indexed as `depth`; range pictures and `slanted` only

  // Range pictures only.
  bool spherical = false;
  bool wraps = false;                ///< the picture goes all around
  std::vector<std::int32_t> row_at;  ///< [bins from straight up to straight down] row + 1; 0 none
  float bins_per_rad = 0;
  std::vector<float> row_down,
      row_right;  ///< [height + 2] rad: angle of row y - 1 and of its start
  float columns_per_rad = 0, first_column = 0;
  Vec3f down_axis;  ///< the camera's y axis, in blocks per metre

  float pixel_rad = 0;  ///< approximate angle between neighbouring pixels
  float truncation_m = 0;
  float least_band_m = 0;  ///< least band of a slanted pinhole behind its planes
  std::optional<Precision> precision;
};

/// Sets all fields except the pixels. False: the frame cannot be used: invalid intrinsics, no
/// pixels in the region, or a pose that is not finite or more than 1000 km from the origin.
bool set_frame(const DepthFrame& frame, const VolumeConfig& config, FrameView& view);

}  // namespace mr::fusion
