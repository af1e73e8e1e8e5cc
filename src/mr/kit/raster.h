#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"

/// A mesh as a camera sees it: depth and triangle per pixel, on the CPU.
namespace mr::kit {

inline constexpr std::uint32_t kNoTriangle = 0xFFFFFFFFu;
inline constexpr double kNearPlane_m = 0.05;

struct Raster {
  ImageDepth depth;  ///< metres along z of the nearest surface; 0: nothing
  ImageId triangle;  ///< which triangle that is; kNoTriangle: nothing
};

/// Draws both sides of every triangle into an undistorted pinhole camera, clipped at the near
/// plane. Parallel over bands of rows; the result does not depend on the threads.
Raster rasterize(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera);

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

/// Calls pixel(x, y, depth_m) for every pixel centre inside the triangle a, b, c (either winding,
/// borders included) whose row lies in [first_row, end_row).
template <typename PixelFunction>
void scan_triangle(const ScreenPoint& a, const ScreenPoint& b, const ScreenPoint& c, int width,
                   int first_row, int end_row, PixelFunction&& pixel) {
  const double area = (b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v);
  if (area == 0 || !std::isfinite(area)) return;
  const auto limit = [](double v, int low, int high) {
    return static_cast<int>(std::clamp(v, static_cast<double>(low), static_cast<double>(high)));
  };
  const int x0 = limit(std::ceil(std::min({a.u, b.u, c.u})), 0, width);
  const int x1 = limit(std::floor(std::max({a.u, b.u, c.u})), -1, width - 1);
  const int y0 = limit(std::ceil(std::min({a.v, b.v, c.v})), first_row, end_row);
  const int y1 = limit(std::floor(std::max({a.v, b.v, c.v})), first_row - 1, end_row - 1);
  // Barycentric weights change by constants from pixel to pixel of a row.
  const double wa_step = (b.v - c.v) / area, wb_step = (c.v - a.v) / area;
  for (int y = y0; y <= y1; ++y) {
    const double wa_0 = ((b.u - x0) * (c.v - y) - (c.u - x0) * (b.v - y)) / area;
    const double wb_0 = ((c.u - x0) * (a.v - y) - (a.u - x0) * (c.v - y)) / area;
    for (int x = x0; x <= x1; ++x) {
      const double wa = wa_0 + (x - x0) * wa_step, wb = wb_0 + (x - x0) * wb_step, wc = 1 - wa - wb;
      if (wa < 0 || wb < 0 || wc < 0) continue;
      pixel(x, y, 1 / (wa * a.inv_z + wb * b.inv_z + wc * c.inv_z));
    }
  }
}

/// scan_triangle over a clipped polygon.
template <typename PixelFunction>
void scan_polygon(const ScreenPolygon& p, int width, int first_row, int end_row,
                  PixelFunction&& pixel) {
  for (int i = 2; i < p.count; ++i)
    scan_triangle(p.points[0], p.points[i - 1], p.points[i], width, first_row, end_row, pixel);
}

}  // namespace mr::kit
