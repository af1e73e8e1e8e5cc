#include "mr/sensor/depth_to_color.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"

namespace mr::sensor {
namespace {

constexpr double kNoise_m = 0.01, kSlope = 6;  ///< tangent of 80 degrees
constexpr double kMostSide_px = 100;           ///< of a block: beyond, it is no neighbourhood

constexpr std::size_t kGrain = 4096;  ///< pixels

/// A depth pixel in the colour picture.
struct ColorPoint {
  Vec2d pixel;
  float depth_m = 0;         ///< in the depth camera; 0: none
  double color_depth_m = 0;  ///< in the colour camera
};

/// z of a pinhole, else the range.
double depth_of_point(const Camera& camera, Vec3d p) {
  return camera.model == CameraModel::pinhole ? p.z : length(p);
}

/// How much farther than its neighbour a pixel of one surface may lie.
class SurfaceSlack {
 public:
  explicit SurfaceSlack(const Camera& camera) : per_m_(kSlope / kit::pixels_per_rad(camera).x) {}
  double operator()(double depth_m) const { return kNoise_m + per_m_ * depth_m; }

 private:
  double per_m_;
};

std::vector<ColorPoint> points_in_color(const ImageDepth& depth, const Camera& depth_camera,
                                        const Camera& color_camera, const Pose& T_color_depth) {
  MR_ASSERT(depth.width == depth_camera.width && depth.height == depth_camera.height);
  std::vector<ColorPoint> out(depth.data.size());
  const auto width = static_cast<std::size_t>(depth.width);
  const auto place = [&](std::size_t i) {
    const float m = depth.data[i];
    if (!(m > 0)) return;
    const Vec2d at{static_cast<double>(i % width), static_cast<double>(i / width)};
    const Vec3d p = T_color_depth * (unproject(depth_camera, at) * static_cast<double>(m));
    if (const auto pixel = project(color_camera, p))
      out[i] = {*pixel, m, depth_of_point(color_camera, p)};
  };
  parallel_for(out.size(), kGrain, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) place(i);
  });
  return out;
}

/// Draws a triangle of a block: depth by 1 / depth, which is linear in a pinhole's picture.
void draw(const std::array<const ColorPoint*, 3>& corners, ImageDepth& out) {
  const Vec2d a = corners[0]->pixel, b = corners[1]->pixel, c = corners[2]->pixel;
  const auto [left, right] = std::minmax({a.x, b.x, c.x});
  const auto [top, bottom] = std::minmax({a.y, b.y, c.y});
  if (right - left > kMostSide_px || bottom - top > kMostSide_px) return;
  const double area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  if (std::abs(area) < 1e-9) return;
  constexpr double kEdge = -1e-9;  // neighbours share their edges
  const int first_x = kit::ceil_within(left, 0, out.width - 1);
  const int last_x = kit::floor_within(right, -1, out.width - 1);
  const int last_y = kit::floor_within(bottom, -1, out.height - 1);
  for (int y = kit::ceil_within(top, 0, out.height - 1); y <= last_y; ++y)
    for (int x = first_x; x <= last_x; ++x) {
      const double of_b = ((x - a.x) * (c.y - a.y) - (y - a.y) * (c.x - a.x)) / area;
      const double of_c = ((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x)) / area;
      const double of_a = 1 - of_b - of_c;
      if (of_a < kEdge || of_b < kEdge || of_c < kEdge) continue;
      const double inverse = of_a / corners[0]->color_depth_m + of_b / corners[1]->color_depth_m +
                             of_c / corners[2]->color_depth_m;
      float& nearest = *out.at(x, y);
      const auto m = static_cast<float>(1 / inverse);
      if (nearest == 0 || m < nearest) nearest = m;
    }
}

ImageDepth drawn(std::span<const ColorPoint> points, const Camera& depth_camera,
                 const Camera& color_camera) {
  ImageDepth out(color_camera.width, color_camera.height);
  const SurfaceSlack slack(depth_camera);
  const auto width = static_cast<std::size_t>(depth_camera.width);
  for (std::size_t y = 0; y + 1 < static_cast<std::size_t>(depth_camera.height); ++y)
    for (std::size_t x = 0; x + 1 < width; ++x) {
      const std::array block{&points[y * width + x], &points[y * width + x + 1],
                             &points[(y + 1) * width + x], &points[(y + 1) * width + x + 1]};
      const auto [near, far] =
          std::minmax({block[0]->depth_m, block[1]->depth_m, block[2]->depth_m, block[3]->depth_m});
      if (near <= 0 || far - near > slack(near)) continue;
      draw({block[0], block[1], block[2]}, out);
      draw({block[1], block[3], block[2]}, out);
    }
  return out;
}

/// The nearest depth around a position; 0: none.
float nearest_around(const ImageDepth& depth, Vec2d at) {
  const int x0 = std::clamp(static_cast<int>(at.x), 0, depth.width - 1);
  const int y0 = std::clamp(static_cast<int>(at.y), 0, depth.height - 1);
  const int x1 = std::min(x0 + 1, depth.width - 1), y1 = std::min(y0 + 1, depth.height - 1);
  float nearest = 0;
  for (const float m : {*depth.at(x0, y0), *depth.at(x1, y0), *depth.at(x0, y1), *depth.at(x1, y1)})
    if (m > 0 && (nearest == 0 || m < nearest)) nearest = m;
  return nearest;
}

}  // namespace

ImageDepth depth_in_color(const ImageDepth& depth, const Camera& depth_camera,
                          const Camera& color_camera, const Pose& T_color_depth) {
  return drawn(points_in_color(depth, depth_camera, color_camera, T_color_depth), depth_camera,
               color_camera);
}

DepthColors color_for_depth(const ImageDepth& depth, const ImageRgb& color,
                            const Camera& depth_camera, const Camera& color_camera,
                            const Pose& T_color_depth) {
  MR_ASSERT(color.width == color_camera.width && color.height == color_camera.height);
  const auto points = points_in_color(depth, depth_camera, color_camera, T_color_depth);
  const ImageDepth nearest = drawn(points, depth_camera, color_camera);
  // A surface's next depth pixel may lie farther than its next colour pixel.
  const SurfaceSlack slack(depth_camera);
  const Rect whole{0, 0, color.width, color.height};
  DepthColors out{ImageRgb(depth.width, depth.height), ImageMask(depth.width, depth.height)};
  const auto look_up = [&](std::size_t i) {
    const ColorPoint& p = points[i];
    if (p.depth_m <= 0 || p.pixel.x < 0 || p.pixel.y < 0 || p.pixel.x > color.width - 1 ||
        p.pixel.y > color.height - 1)
      return;
    const double front = nearest_around(nearest, p.pixel);
    if (front > 0 && p.color_depth_m > front + slack(front)) return;
    const auto rgb = sample_bilinear(color, whole, p.pixel.x, p.pixel.y);
    std::ranges::copy(rgb, out.color.data.begin() + static_cast<std::ptrdiff_t>(3 * i));
    out.seen.data[i] = 1;
  };
  parallel_for(points.size(), kGrain, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) look_up(i);
  });
  return out;
}

}  // namespace mr::sensor
