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
/// Tangent of the change of direction from one step to the next above which there is a corner.
constexpr float kCorner = 0.25f;
constexpr float kStraight = 0.2f;  // largest relative change from one step to the next

/// The inverse ranges of a row and of two rows on either side, turned so that their columns align
/// with the middle one's; 0: invalid.
class AlignedRows {
 public:
  static constexpr int kReach = 2;

  explicit AlignedRows(int width) : width_(width) {
    for (auto& row : rows_) row.resize(static_cast<std::size_t>(width) + 2 * kReach);
  }

  void set(const FrameView& view, const std::vector<float>& inverse, int y) {
    for (int i = -kReach; i <= kReach; ++i) {
      const int row = y + i;
      const float turned =  // rows may have azimuth offsets
          view.row_right[y + 1] - view.row_right[std::clamp(row, 0, view.height - 1) + 1];
      const int off = static_cast<int>(std::lround(turned * view.columns_per_rad));
      if (row < 0 || row >= view.height)
        std::ranges::fill(rows_[i + kReach], 0.0f);
      else
        copy(&inverse[static_cast<std::size_t>(row) * width_], off, view.wraps, rows_[i + kReach]);
    }
  }
  /// Pixel 0 of the row `i` below; two more can be read on either side.
  const float* row(int i) const { return rows_[i + kReach].data() + kReach; }

 private:
  void copy(const float* from, int off, bool wraps, std::vector<float>& to) const {
    for (int x = -kReach, at = off - kReach; x < width_ + kReach; ++x, ++at) {
      if (wraps && (at < 0 || at >= width_)) at = (at % width_ + width_) % width_;
      to[x + kReach] = at >= 0 && at < width_ ? from[at] : 0.0f;
    }
  }

  int width_;
  std::array<std::vector<float>, 2 * kReach + 1> rows_;
};

/// The inverse ranges of five pixels in a line, for each pixel of a row; [2] is the centre.
using Lines = std::array<const float*, 5>;

/// Whether two steps are about the same, 0 or 1.
inline int alike(float a, float b, float tolerance) {
  return static_cast<int>(std::abs(a - b) <=
                          kStraight * std::max(std::abs(a), std::abs(b)) + tolerance);
}

/// The change of inverse range per pixel along a line, `angle` being between neighbours, radians:
/// the mean of both sides; at a corner that of the side that goes on straight. Branch-free, so that
/// it is vectorised.
void slopes(const Lines& w, float angle, int width, float* out) {
  const float *const w0 = w[0], *const w1 = w[1], *const w2 = w[2], *const w3 = w[3],
                     *const w4 = w[4];
  const auto steep = [&](float step, float a,
                         float b) {  // |dr| / (r · angle), with dr / r = dw / w
    return static_cast<int>(std::abs(step) * kSteepestRange > angle * std::min(a, b));
  };
  for (int x = 0; x < width; ++x) {
    // Step i leads from pixel i to i + 1.
    const float a = w0[x], b = w1[x], c = w2[x], d = w3[x], e = w4[x];
    const float step0 = b - a, step1 = c - b, step2 = d - c, step3 = e - d;
    const int has0 = (a > 0) & (b > 0), has1 = (b > 0) & (c > 0), has2 = (c > 0) & (d > 0),
              has3 = (d > 0) & (e > 0);
    const int across = has1 & has2 & alike(step1, step2, 0);
    const int goes_on1 = across | (has0 & has1 & alike(step0, step1, 0));
    const int goes_on2 = across | (has2 & has3 & alike(step2, step3, 0));
    const int before = has1 & ((1 ^ steep(step1, b, c)) | goes_on1);
    const int after = has2 & ((1 ^ steep(step2, c, d)) | goes_on2);
    const float tolerance = kCorner * angle * c;
    const int corner = before & after & (1 ^ alike(step1, step2, tolerance));
    const int straight1 = has0 & alike(step0, step1, tolerance);
    const int straight2 = has3 & alike(step2, step3, tolerance);
    const int use1 = before & (1 ^ (corner & straight2 & (1 ^ straight1)));
    const int use2 = after & (1 ^ (corner & straight1 & (1 ^ straight2)));
    const float half = use1 & use2 ? 0.5f : 1.0f;
    out[x] = half * ((use1 ? step1 : 0.0f) + (use2 ? step2 : 0.0f));
  }
}

/// The planes of row y. `right`, `down`: room for a row of slopes.
void fit_row(FrameView& view, const AlignedRows& rows, int y, float* right, float* down) {
  const float cos_down = std::max(std::cos(view.row_down[y + 1]), 1e-3f);
  const float right_rad = 1 / view.columns_per_rad;
  const float* const own = rows.row(0);
  slopes({own - 2, own - 1, own, own + 1, own + 2}, right_rad * cos_down, view.width, right);
  const int above = std::max(y - 1, 0), below = std::min(y + 1, view.height - 1);
  const float down_rad = above == below ? 0.0f
                                        : (view.row_down[below + 1] - view.row_down[above + 1]) /
                                              static_cast<float>(below - above);
  if (down_rad != 0)
    slopes({rows.row(-2), rows.row(-1), own, rows.row(1), rows.row(2)}, std::abs(down_rad),
           view.width, down);
  const float per_down = down_rad != 0 ? down_rad : 1.0f, has_down = down_rad != 0 ? 1.0f : 0.0f;
  RangePlane* const out = &view.planes[view.place(0, y)];
  for (int x = 0; x < view.width; ++x) {
    const float w = own[x];
    if (w == 0) continue;
    RangePlane plane{w, right[x] / right_rad, has_down * down[x] / per_down, 1};
    const float across = plane.right / (w * cos_down), along = plane.down / w;
    plane.cosine = 1 / std::sqrt(1 + across * across + along * along);
    out[x] = plane;
  }
}

/// Half the angle between row y and its neighbours, the larger one.
float half_gap_rad(const FrameView& view, int y) {
  float gap = 0;
  for (const int other : {y - 1, y + 1})
    if (other >= 0 && other < view.height)
      gap = std::max(gap, std::abs(view.row_down[other + 1] - view.row_down[y + 1]));
  return gap > 0 ? gap / 2 : 0.5f / view.columns_per_rad;
}

/// What all pixels of a row share: how a point of a range picture moves downwards.
struct RowTurn {
  Vec3f down_axis;
  float tan_down = 0;

  RowTurn() = default;
  RowTurn(const FrameView& view, int y)
      : down_axis(view.down_axis * std::cos(view.row_down[y + 1])),
        tan_down(std::tan(view.row_down[y + 1])) {}
};

/// The part of a pixel's plane between two corners, in the plane's own units (radians, or pixels of
/// a slanted pinhole) from the pixel's middle; in blocks from eye_block.
class Patch {
 public:
  /// `row`: of a range picture.
  Patch(const FrameView& view, const RowTurn& row, int x, int y)
      : plane_(view.planes[view.place(x, y)]), eye_(view.eye), ahead_(view.direction(x, y)) {
    if (view.spherical) {
      const Vec3f flat = ahead_ - view.ray[y][0];  // times the cosine of `down`
      aside_ = view.ray[y][1] * view.t[x] - view.ray[y][2] * view.s[x];
      down_ = row.down_axis - flat * row.tan_down;
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

/// Turns boxes into ranges of voxels, as many as are together no larger than a piece into one.
class BoxCollector {
 public:
  BoxCollector(float margin, std::vector<VoxelRange>& out) : margin_(margin), out_(out) {}

  static bool is_small(const Box3f& box) {
    const Vec3f extent = box.high - box.low;
    return std::max({extent.x, extent.y, extent.z}) <= kPiece;
  }
  void add(const Box3f& box) {
    Box3f both = open_;
    both.add(box.low), both.add(box.high);
    if (!is_small(both)) flush(), both = box;
    open_ = both;
  }
  void flush() {
    if (!open_.empty()) out_.push_back(voxels_within(open_.low, open_.high, margin_));
    open_ = {};
  }

 private:
  Box3f open_;
  float margin_;
  std::vector<VoxelRange>& out_;
};

}  // namespace

void fit_range_planes(FrameView& view) {
  view.planes.assign(view.depth.size(), {});
  const auto width = static_cast<std::size_t>(view.width);
  std::vector<float> inverse(width * view.height);
  parallel_for(view.height, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      const float* const range = view.row(static_cast<int>(y));
      for (std::size_t x = 0; x < width; ++x)
        inverse[y * width + x] = range[x] > 0 ? 1 / range[x] : 0.0f;
    }
  });
  parallel_for(view.height, 8, [&](std::size_t begin, std::size_t end) {
    AlignedRows rows(view.width);
    std::vector<float> right(width), down(width);
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      rows.set(view, inverse, y);
      fit_row(view, rows, y, right.data(), down.data());
    }
  });
}

void plane_ranges(const FrameView& view, int y, float margin_blocks, std::vector<VoxelRange>& out) {
  const float right = 0.5f / view.columns_per_rad, down = half_gap_rad(view, y);
  // Dense pixels: the margin around a pixel's point contains its plane patch.
  const float blocks_per_m = length(view.down_axis);
  const float near = 0.5f * margin_blocks / (blocks_per_m * std::hypot(right, down));
  const RowTurn turn(view, y);
  BoxCollector boxes(margin_blocks, out);
  for (int x = 0; x < view.width; ++x) {
    const float range = view.row(y)[x];
    if (range <= 0) continue;
    if (range < near * view.planes[view.place(x, y)].cosine) {
      const Vec3f point = view.eye + view.direction(x, y) * range;
      const float wider = 0.5f * margin_blocks;
      boxes.add({point - Vec3f{wider, wider, wider}, point + Vec3f{wider, wider, wider}});
      continue;
    }
    const Patch patch(view, turn, x, y);
    const Vec3f a = patch.at(-right, -down), b = patch.at(right, -down), c = patch.at(-right, down),
                d = patch.at(right, down);
    Box3f box;
    for (const Vec3f corner : {a, b, c, d}) box.add(corner);
    if (BoxCollector::is_small(box))
      boxes.add(box);
    else
      patch_ranges(patch, right, down, margin_blocks, out);
  }
  boxes.flush();
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
        patch_ranges(Patch(view, {}, x, y), kHalf, kHalf, margin_blocks, out);
    }
}

}  // namespace mr::fusion
