#include "mr/fusion/ray_grid.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr double kBeam_rad = 0.009;  // LiDAR beams farther apart than half a degree do not overlap
constexpr double kPi = std::numbers::pi;

constexpr float kLeast_m = 1e-6f, kMost_m = 1e6f;  // depths outside are invalid

int wrapped(int x, int width) { return ((x % width) + width) % width; }

/// Converts a row of depth to inverse depth and rotates it. Branch-free, so that it is vectorised.
void invert_row(const float* depth, int count, float* out) {
  for (int x = 0; x < count; ++x) {
    const float d = depth[x];
    const int good = (d > kLeast_m) & (d < kMost_m);
    const float safe = std::min(kMost_m, std::max(kLeast_m, d));  // also of NaN
    out[x] = static_cast<float>(good) * (1 / safe);
  }
}

void depth_row(const float* grid, const float* before, int count, float* out) {
  for (int x = 0; x < count; ++x) {
    const float w = grid[x];
    const bool good = w > 0;
    const float z = 1.0f / (good ? w : 1.0f);
    const float was = before ? before[x] : 0.0f;
    out[x] = good ? (was > kLeast_m && was < kMost_m ? was : z) : 0.0f;
  }
}

}  // namespace

RaySpacing::RaySpacing(int w, int h)
    : width(w), height(h), turn(h, 0), across_rad(h), altitude_rad(h) {
  const float step = 0.5f / static_cast<float>(std::max({w, h, 1}));
  std::fill(across_rad.begin(), across_rad.end(), step);
  for (int y = 0; y < h; ++y) altitude_rad[y] = step * static_cast<float>(y);
}

RaySpacing::RaySpacing(const Camera& camera) : RaySpacing(camera.width, camera.height) {
  around = camera.model != CameraModel::pinhole;
  double steepest = 0;
  for (int y = 0; y < height; ++y) {
    double across = 1 / camera.fx, down = y / camera.fy;
    if (around) {
      const bool lidar = camera.model == CameraModel::lidar;
      down = lidar ? -camera.beam_altitude_rad[y] : ((y + 0.5) / height - 0.5) * kPi;
      across = 2 * kPi / width * std::max(std::cos(down), 1e-3);
      if (lidar)
        turn[y] = static_cast<int>(std::lround(camera.beam_azimuth_rad[y] / (2 * kPi) * width));
    }
    across_rad[y] = static_cast<float>(across);
    altitude_rad[y] = static_cast<float>(down);
    if (y > 0) steepest = std::max<double>(steepest, std::abs(down_rad(y - 1)));
  }
  rows_touch = camera.model != CameraModel::lidar || steepest <= kBeam_rad;
}

float RaySpacing::down_rad(int y) const {
  return y < 0 || y + 1 >= height ? 0.0f : altitude_rad[y + 1] - altitude_rad[y];
}

RayGrid::RayGrid(int width, int height, bool around)
    : width_(width),
      height_(height),
      around_(around),
      data_(static_cast<std::size_t>(width + 2 * kMargin) * (height + 2 * kMargin)) {}

void RayGrid::wrap(int y) {
  if (!around_) return;
  float* const out = row(y);
  for (int i = 1; i <= kMargin; ++i) {
    out[-i] = out[wrapped(-i, width_)];
    out[width_ - 1 + i] = out[(i - 1) % width_];
  }
}

RayGrid to_grid(const ImageDepth& depth, const RaySpacing& rays) {
  RayGrid grid(depth.width, depth.height, rays.around);
  if (depth.empty()) return grid;
  parallel_for(depth.height, 64, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const int first = wrapped(rays.turn[y], depth.width);
      invert_row(depth.row(y), depth.width - first, grid.row(y) + first);
      invert_row(depth.row(y) + depth.width - first, first, grid.row(y));
      grid.wrap(y);
    }
  });
  return grid;
}

ImageDepth to_depth(const RayGrid& grid, const RaySpacing& rays, const ImageDepth* before) {
  ImageDepth out(grid.width(), grid.height());
  if (out.empty()) return out;
  parallel_for(out.height, 64, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const int first = wrapped(rays.turn[y], out.width), rest = out.width - first;
      const float* const was = before ? before->row(y) : nullptr;
      depth_row(grid.row(y) + first, was, rest, out.row(y));
      depth_row(grid.row(y), was ? was + rest : nullptr, first, out.row(y) + rest);
    }
  });
  return out;
}

}  // namespace mr::fusion
