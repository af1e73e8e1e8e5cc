#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"

/// A software rasterizer: depth and triangle ID per pixel, on the CPU.
namespace mr::kit {

inline constexpr std::uint32_t kNoTriangle = 0xFFFFFFFFu;
inline constexpr double kNearPlane_m = 0.05;

struct Raster {
  ImageDepth depth;  ///< metres along z of the nearest surface; 0: nothing
  ImageId triangle;  ///< ID of that triangle; kNoTriangle: nothing
};

/// Rasterizes both sides of every triangle with a z-buffer for an undistorted pinhole camera,
/// clipped at the near plane. Parallel over bands of rows; the result does not depend on the
/// threads.
Raster rasterize(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera);
/// Only the z-buffer; faster.
ImageDepth rasterize_depth(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera);

/// The same pinhole view with `factor` times as many pixels a side.
Camera scaled(const Camera& camera, double factor);

/// Pixels per radian to the right (x) and downwards (y): of a pinhole in the middle of its picture,
/// of a LiDAR's rows on average.
Vec2d pixels_per_rad(const Camera& camera);

/// One face of the cube map around a panorama or a LiDAR: a pinhole camera.
struct CubeFace {
  Camera camera;       ///< width = height; overlaps its neighbours by `ring_px` pixels
  Mat3 R_camera_face;  ///< turns from the face to the camera
  int ring_px = 0;
};

/// Towards x, -x, y, -y, z, -z of the camera. `focal_px`: of each.
std::array<CubeFace, 6> cube_faces(double focal_px, int ring_px);

/// A point in the picture: pixel position and 1 / depth.
struct ScreenPoint {
  double u = 0, v = 0, inv_z = 0;
};

inline ScreenPoint to_screen(const Camera& camera, Vec3d p_camera) {
  return {camera.fx * p_camera.x / p_camera.z + camera.cx,
          camera.fy * p_camera.y / p_camera.z + camera.cy, 1 / p_camera.z};
}

/// A triangle clipped at the near plane: a polygon of 0, 3 or 4 points.
struct ScreenPolygon {
  std::array<ScreenPoint, 4> points;
  int count = 0;
};
ScreenPolygon clip_to_screen(const Camera& camera, const std::array<Vec3d, 3>& corners_camera);

/// A mesh's vertices in a pinhole's frame and in its picture.
struct Projection {
  std::vector<Vec3d> in_camera;        ///< [V]
  std::vector<ScreenPoint> on_screen;  ///< [V] without meaning nearer than the near plane

  Projection() = default;
  Projection(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera);
  /// A triangle of the mesh, clipped at the near plane.
  ScreenPolygon polygon(const Camera& camera, const Triangle& t) const;
};

/// A part of a picture with the depth of some triangles in it: (0, 0) of `depth` lies at `x`, `y`.
/// `triangles`: which ones of the mesh; every one that reaches into the part.
struct DepthPart {
  int x = 0, y = 0;
  ImageDepth depth;
};
/// Rasterizes into `part.depth`, which has its size and is 0. Parallel as rasterize().
void rasterize_part(const Mesh& mesh, const Camera& camera, const Projection& projection,
                    std::span<const std::uint32_t> triangles, DepthPart& part);

/// The pixels of one row inside a triangle: `first` to `last`, with 1 / depth at `first` and its
/// increment per pixel.
struct ScreenSpan {
  int y = 0, first = 0, last = -1;
  float inv_z = 0, inv_z_step = 0;
};

/// Intersects the edge from a to b, a.v <= b.v, with rows; identical for both triangles at the
/// edge.
class ScreenEdge {
 public:
  ScreenEdge(const ScreenPoint& a, const ScreenPoint& b)
      : u_(a.u), v_(a.v), slope_(a.v < b.v ? (b.u - a.u) / (b.v - a.v) : 0) {}
  double at_row(int y) const { return u_ + (y - v_) * slope_; }

 private:
  double u_, v_, slope_;
};

/// Smallest integer that is not below v, limited to [low, high]; low where v is not a number.
inline int ceil_within(double v, int low, int high) {
  if (!(v > low)) return low;
  if (v >= high) return high;
  const int i = static_cast<int>(v);
  return i + (i < v);
}
/// Largest integer that is not above v, limited to [low, high]; low where v is not a number.
inline int floor_within(double v, int low, int high) {
  if (!(v > low)) return low;
  if (v >= high) return high;
  const int i = static_cast<int>(v);
  return i - (i > v);
}

/// Calls span(ScreenSpan) for each row of [first_row, end_row) that holds pixel centres inside the
/// triangle a, b, c (either winding, borders included).
template <typename SpanFunction>
void scan_triangle(ScreenPoint a, ScreenPoint b, ScreenPoint c, int width, int first_row,
                   int end_row, SpanFunction&& span) {
  if (b.v < a.v) std::swap(a, b);
  if (c.v < a.v) std::swap(a, c);
  if (c.v < b.v) std::swap(b, c);
  const double area = (b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v);
  const int y0 = ceil_within(a.v, first_row, end_row);
  const int y1 = floor_within(c.v, first_row - 1, end_row - 1);
  const bool beside = std::max({a.u, b.u, c.u}) < 0 || std::min({a.u, b.u, c.u}) > width - 1;
  if (area == 0 || !std::isfinite(area) || y0 > y1 || beside) return;
  const double du = ((b.inv_z - a.inv_z) * (c.v - a.v) - (c.inv_z - a.inv_z) * (b.v - a.v)) / area;
  const double dv = ((c.inv_z - a.inv_z) * (b.u - a.u) - (b.inv_z - a.inv_z) * (c.u - a.u)) / area;
  const ScreenEdge a_c(a, c), a_b(a, b), b_c(b, c);
  for (int y = y0; y <= y1; ++y) {
    const bool upper = y < b.v || (y == b.v && a.v < b.v);
    const double u = a_c.at_row(y), other_u = upper ? a_b.at_row(y) : b_c.at_row(y);
    const int first = ceil_within(std::min(u, other_u), 0, width);
    const int last = floor_within(std::max(u, other_u), -1, width - 1);
    if (first > last) continue;
    const double inv_z = a.inv_z + (first - a.u) * du + (y - a.v) * dv;
    span(ScreenSpan{y, first, last, static_cast<float>(inv_z), static_cast<float>(du)});
  }
}

/// scan_triangle over a clipped polygon.
template <typename SpanFunction>
void scan_polygon(const ScreenPolygon& p, int width, int first_row, int end_row,
                  SpanFunction&& span) {
  for (int i = 2; i < p.count; ++i)
    scan_triangle(p.points[0], p.points[i - 1], p.points[i], width, first_row, end_row, span);
}

}  // namespace mr::kit
