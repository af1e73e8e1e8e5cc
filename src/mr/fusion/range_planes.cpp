#include "mr/fusion/range_planes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "mr/core/parallel.h"
#include "mr/fusion/voxel_block.h"

namespace mr::fusion {
namespace {

/// Tangent of the least angle between ray and surface; below it a line must be straight.
constexpr float kSteepestRange = 0.15f;
constexpr float kStraight = 0.2f;  // largest relative change from one step to the next

/// The inverse ranges of five pixels in a line; [2] is the centre; 0: invalid.
using Line = std::array<float, 5>;

/// The change of inverse range per pixel along a line, `angle` being between neighbours, radians.
float slope(const Line& w, float angle) {
  // Step i leads from pixel i to i + 1.
  const auto step = [&](int i) { return w[i + 1] - w[i]; };
  const auto measured = [&](int i) { return w[i] > 0 && w[i + 1] > 0; };
  const auto steep = [&](int i) {  // |dr| / (r · angle), with dr / r = dw / w
    return std::abs(step(i)) * kSteepestRange > angle * std::min(w[i], w[i + 1]);
  };
  const auto straight = [&](int i, int j) {
    return measured(i) && measured(j) &&
           std::abs(step(i) - step(j)) <=
               kStraight * std::max(std::abs(step(i)), std::abs(step(j)));
  };
  const auto goes_on = [&](int i, int j) { return straight(1, 2) || straight(i, j); };
  const bool before = measured(1) && (!steep(1) || goes_on(0, 1));
  const bool after = measured(2) && (!steep(2) || goes_on(2, 3));
  if (before && after) return 0.5f * (step(1) + step(2));
  return before ? step(1) : after ? step(2) : 0.0f;
}

float inverse(const FrameView& view, int x, int y) {
  if (y < 0 || y >= view.height) return 0;
  if (view.wraps) x = (x % view.width + view.width) % view.width;
  if (x < 0 || x >= view.width) return 0;
  const float range = view.row(y)[x];
  return range > 0 ? 1 / range : 0.0f;
}

RangePlane plane_at(const FrameView& view, int x, int y) {
  RangePlane plane;
  plane.inverse = inverse(view, x, y);
  if (plane.inverse == 0) return plane;
  Line across_rows, along_row;
  for (int i = 0; i < 5; ++i) {
    const int row = std::clamp(y + i - 2, 0, view.height - 1);  // rows may have azimuth offsets
    const float turned = view.row_right[y + 1] - view.row_right[row + 1];
    const int column = x + static_cast<int>(std::lround(turned * view.columns_per_rad));
    along_row[i] = inverse(view, x + i - 2, y);
    across_rows[i] = inverse(view, column, y + i - 2);
  }
  const float cos_down = std::max(std::cos(view.row_down[y + 1]), 1e-3f);
  const float right_rad = 1 / view.columns_per_rad;
  plane.right = slope(along_row, right_rad * cos_down) / right_rad;
  const int above = std::max(y - 1, 0), below = std::min(y + 1, view.height - 1);
  if (above < below) {
    const float down_rad =
        (view.row_down[below + 1] - view.row_down[above + 1]) / static_cast<float>(below - above);
    if (down_rad != 0) plane.down = slope(across_rows, std::abs(down_rad)) / down_rad;
  }
  const float right = plane.right / (plane.inverse * cos_down), down = plane.down / plane.inverse;
  plane.cosine = 1 / std::sqrt(1 + right * right + down * down);
  return plane;
}

/// Half the angle between row y and its neighbours, the larger one.
float half_gap_rad(const FrameView& view, int y) {
  float gap = 0;
  for (const int other : {y - 1, y + 1})
    if (other >= 0 && other < view.height)
      gap = std::max(gap, std::abs(view.row_down[other + 1] - view.row_down[y + 1]));
  return gap > 0 ? gap / 2 : 0.5f / view.columns_per_rad;
}

/// The part of a pixel's plane between two corners, in the plane's own units (radians, or pixels of
/// a slanted pinhole) from the pixel's middle; in blocks from eye_block.
class Patch {
 public:
  Patch(const FrameView& view, int x, int y)
      : plane_(view.planes[view.place(x, y)]), eye_(view.eye), ahead_(view.direction(x, y)) {
    if (view.spherical) {
      const float down = view.row_down[y + 1];
      const Vec3f flat = ahead_ - view.ray[y][0];  // times the cosine of `down`
      aside_ = view.ray[y][1] * view.t[x] - view.ray[y][2] * view.s[x];
      down_ = view.down_axis * std::cos(down) - flat * std::tan(down);
    } else {
      aside_ = view.ray[y][1] * view.per_pixel.x;
      down_ = view.down_per_pixel;
    }
  }
  Vec3f at(float right, float down) const {
    const float half = 0.5f * plane_.inverse;
    const float moved = std::clamp(plane_.right * right + plane_.down * down, -half, half);
    return eye_ + (ahead_ + aside_ * right + down_ * down) / (plane_.inverse + moved);
  }

 private:
  RangePlane plane_;
  Vec3f eye_, ahead_, aside_, down_;
};

/// A patch is divided into pieces of about this size, so that their boxes fit tightly.
constexpr float kPiece = 0.5f;   // blocks
constexpr int kMostPieces = 32;  // along a side; parts farther from the ray are omitted

void patch_ranges(const Patch& patch, float right, float down, float margin,
                  std::vector<VoxelRange>& out) {
  const auto pieces = [](float length_blocks, float& reach_rad) {
    const float count = std::max(std::ceil(length_blocks / kPiece), 1.0f);
    if (count > kMostPieces) reach_rad *= kMostPieces / count;
    return static_cast<int>(std::min<float>(count, kMostPieces));
  };
  const int columns = pieces(length(patch.at(right, 0) - patch.at(-right, 0)), right);
  const int rows = pieces(length(patch.at(0, down) - patch.at(0, -down)), down);
  const auto corner = [&](int i, int j) {
    return patch.at(right * static_cast<float>(2 * i - columns) / static_cast<float>(columns),
                    down * static_cast<float>(2 * j - rows) / static_cast<float>(rows));
  };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      Box3f box;
      for (const int dj : {0, 1})
        for (const int di : {0, 1}) box.add(corner(i + di, j + dj));
      out.push_back(voxels_within(box.low, box.high, margin));
    }
}

}  // namespace

void fit_range_planes(FrameView& view) {
  view.planes.assign(view.depth.size(), {});
  parallel_for(view.height, 8, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < view.width; ++x) view.planes[view.place(x, y)] = plane_at(view, x, y);
  });
}

void plane_ranges(const FrameView& view, int y, float margin_blocks, std::vector<VoxelRange>& out) {
  const float right = 0.5f / view.columns_per_rad, down = half_gap_rad(view, y);
  // Dense pixels: the margin around a pixel's point contains its plane patch.
  const float blocks_per_m = length(view.down_axis);
  const float near = 0.5f * margin_blocks / (blocks_per_m * std::hypot(right, down));
  for (int x = 0; x < view.width; ++x) {
    const float range = view.row(y)[x];
    if (range <= 0) continue;
    if (range < near * view.planes[view.place(x, y)].cosine) {
      const Vec3f point = view.eye + view.direction(x, y) * range;
      out.push_back(voxels_within(point, point, 1.5f * margin_blocks));
    } else {
      patch_ranges(Patch(view, x, y), right, down, margin_blocks, out);
    }
  }
}

void steep_ranges(const FrameView& view, const Rect& tile, float margin_blocks,
                  std::vector<VoxelRange>& out) {
  constexpr float kHalf = 0.5f;  // a pixel
  for (int y = tile.y; y < tile.y + tile.height; ++y)
    for (int x = tile.x; x < tile.x + tile.width; ++x) {
      const float depth = view.row(y)[x];
      if (depth <= 0) continue;
      const float apart = depth * length(view.down_per_pixel);  // blocks, facing the sensor
      if (apart > margin_blocks * view.planes[view.place(x, y)].cosine)
        patch_ranges(Patch(view, x, y), kHalf, kHalf, margin_blocks, out);
    }
}

}  // namespace mr::fusion
