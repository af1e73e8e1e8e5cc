#include "mr/still/outline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "mr/core/assert.h"

namespace mr::still {
namespace {

constexpr int kStep_px = PlateDifference::kStep_px, kBlock_px = PlateDifference::kBlock_px;
constexpr float kClear_m = 0.08f;   // between what moves and the room behind, to tell them apart
constexpr int kThin_px = 4;         // colour may add before depth of the room
constexpr double kHair_m = 0.22;    // and where there is no depth
constexpr int kMostlyAround = 5;    // of eight neighbours: these say what colour does not
constexpr float kRound_m = 0.025f;  // see turn_away()
constexpr int kNearBlocks = 2;
constexpr float kOverlap = 1.2f;  // of depth pixels in the plane, so that no gaps are left

constexpr std::array<std::pair<int, int>, 8> kAround{
    {{-1, -1}, {0, -1}, {1, -1}, {-1, 0}, {1, 0}, {-1, 1}, {0, 1}, {1, 1}}};

/// Whether a depth pixel measures what does not move.
bool is_room(const OutlineFinder::Input& in, int x, int y) {
  return *in.measured.at(x, y) > 0 && !*in.moving.at(x, y);
}

/// Whether one of the eight pixels around a pixel is set, as `is_set` says of those in the picture.
template <typename F>
bool any_around(const ImageDepth& picture, int x, int y, const F& is_set) {
  return std::ranges::any_of(kAround, [&](const auto& d) {
    return picture.contains(x + d.first, y + d.second) && is_set(x + d.first, y + d.second);
  });
}

/// Calls `f` for each pixel of the blocks that are set, block by block.
template <typename F>
void each_pixel_of(const ImageMask& blocks, int width, int height, const F& f) {
  for (int row = 0; row < blocks.height; ++row)
    for (int column = 0; column < blocks.width; ++column) {
      if (!*blocks.at(column, row)) continue;
      const int x_end = std::min((column + 1) * kBlock_px, width),
                y_end = std::min((row + 1) * kBlock_px, height);
      for (int y = row * kBlock_px; y < y_end; ++y)
        for (int x = column * kBlock_px; x < x_end; ++x) f(x, y);
    }
}

/// A few pixels of the blocks that are set go with those around them; those that `is_fixed` stay.
void remove_specks(const ImageMask& blocks, const ImageMask& is_fixed, ImageMask& alpha) {
  constexpr int kPasses = 2, kMostOfNine = 5;
  for (int pass = 0; pass < kPasses; ++pass) {
    const ImageMask raw = alpha;
    each_pixel_of(blocks, alpha.width, alpha.height, [&](int x, int y) {
      if (*is_fixed.at(x, y) || x == 0 || y == 0 || x + 1 == alpha.width || y + 1 == alpha.height)
        return;
      int ones = *raw.at(x, y);
      for (const auto& [dx, dy] : kAround) ones += *raw.at(x + dx, y + dy);
      *alpha.at(x, y) = ones >= kMostOfNine;
    });
  }
}

}  // namespace

OutlineFinder::OutlineFinder(const Camera& depth_camera, const Camera& color_camera,
                             const Pose& T_color_depth)
    : depth_camera_(depth_camera),
      color_camera_(color_camera),
      translation_(vec_cast<float>(T_color_depth.translation)),
      width_((color_camera.width + kStep_px - 1) / kStep_px),
      height_((color_camera.height + kStep_px - 1) / kStep_px) {
  for (const Camera& camera : {depth_camera, color_camera})
    MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  const auto turned = [&](Vec3d v) { return vec_cast<float>(T_color_depth.rotation * v); };
  const auto& [fx, fy, cx, cy] =
      std::array{depth_camera.fx, depth_camera.fy, depth_camera.cx, depth_camera.cy};
  ray_ = turned({-cx / fx, -cy / fy, 1});
  ray_right_ = turned({1 / fx, 0, 0}), ray_down_ = turned({0, 1 / fy, 0});
}

Outline OutlineFinder::find(const Input& in) {
  PlateDifference colors(in.colors, was_different_);
  Outline out{in.cleaned, {}};
  MR_ASSERT(colors.width() == width_ && colors.height() == height_);
  const std::vector<Grown> grown = grow(in, colors, out.depth);
  smooth(grown, out.depth);
  turn_away(grown, out.depth);
  DepthPlane plane{Image<Depth, 1>(width_, height_, Depth::none),
                   ImageDepth(width_, height_, std::numeric_limits<float>::infinity())};
  draw_moving(in, out.depth, plane);
  const ImageMask near = near_blocks(plane);
  draw_room(in, out.depth, near, plane);
  out.alpha = decide(colors, plane, near);
  was_different_ = colors.take_different();
  return out;
}

/// Where the colour picture shows a point at a depth pixel.
OutlineFinder::InColor OutlineFinder::in_color(int x, int y, float depth) const {
  const Vec3f ray = ray_ + ray_right_ * static_cast<float>(x) + ray_down_ * static_cast<float>(y);
  const Vec3f p = ray * depth + translation_;
  const float per_z = 1 / p.z;
  return {static_cast<float>(color_camera_.fx) * p.x * per_z + static_cast<float>(color_camera_.cx),
          static_cast<float>(color_camera_.fy) * p.y * per_z + static_cast<float>(color_camera_.cy),
          p.z};
}

/// Of a point at a depth pixel; unknown beside the colour picture.
PlateColor OutlineFinder::color_at(PlateDifference& colors, int x, int y, float depth) const {
  const InColor at = in_color(x, y, depth);
  const float u = at.u + 0.5f, v = at.v + 0.5f;
  if (!(at.z > 0 && u >= 0 && v >= 0 && u < static_cast<float>(color_camera_.width) &&
        v < static_cast<float>(color_camera_.height)))
    return PlateColor::unknown;
  return colors.at(static_cast<int>(u) / kStep_px, static_cast<int>(v) / kStep_px);
}

/// Whether nothing is measured at that depth, or before it, that does not move.
bool OutlineFinder::is_free(const Input& in, int x, int y, float depth) {
  const float measured = *in.measured.at(x, y);
  return !(measured > 0) || *in.moving.at(x, y) || measured > depth + kClear_m;
}

/// The pixels without depth beside some that have one, row by row.
std::vector<OutlineFinder::Grown> OutlineFinder::neighbours(const Input& in,
                                                            const ImageDepth& depth,
                                                            const std::vector<Grown>& of) {
  std::vector<Grown> out;
  for (const Grown& from : of)
    for (const auto& [dx, dy] : kAround)
      if (const int x = from.x + dx, y = from.y + dy; depth.contains(x, y) && !*depth.at(x, y))
        out.push_back({x, y, 0, from.reach + 1, 0});
  std::ranges::sort(out, {}, [](const Grown& g) { return std::tuple(g.y, g.x, g.reach); });
  const auto is_same_place = [](const Grown& a, const Grown& b) {
    return a.x == b.x && a.y == b.y;
  };
  out.erase(std::unique(out.begin(), out.end(), is_same_place), out.end());
  std::erase_if(out, [&](Grown& g) {
    int count = 0;
    for (const auto& [dx, dy] : kAround)
      if (depth.contains(g.x + dx, g.y + dy))
        if (const float d = *depth.at(g.x + dx, g.y + dy); d > 0) g.depth += d, ++count;
    g.depth /= static_cast<float>(count), g.beside = count;
    return !is_free(in, g.x, g.y, g.depth);
  });
  return out;
}

/// Adds what is beside the moving depth and differs from the plate: some pixels before the room,
/// and all within kHair_m where there is no depth. Returns what was added.
std::vector<OutlineFinder::Grown> OutlineFinder::grow(const Input& in, PlateDifference& colors,
                                                      ImageDepth& depth) const {
  std::vector<Grown> edge, all;
  const auto is_empty = [&](int x, int y) { return !(*depth.at(x, y) > 0); };
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x)
      if (const float d = *depth.at(x, y);
          d > 0 && *in.foreign.at(x, y) && any_around(depth, x, y, is_empty))
        edge.push_back({x, y, d, 0, 0});
  while (!edge.empty()) {
    edge = neighbours(in, depth, edge);
    std::erase_if(edge, [&](const Grown& g) {
      const bool before_room = is_room(in, g.x, g.y);
      const double most = before_room ? kThin_px : kHair_m * depth_camera_.fx / g.depth;
      if (g.reach > most) return true;
      const PlateColor color = color_at(colors, g.x, g.y, g.depth);
      if (color == PlateColor::different) return false;
      const bool says_no = color == PlateColor::same || color == PlateColor::unknown;
      return says_no || before_room || g.beside < kMostlyAround;
    });
    for (const Grown& g : edge) *depth.at(g.x, g.y) = g.depth;
    all.insert(all.end(), edge.begin(), edge.end());
  }
  return all;
}

/// Makes what was added a membrane between the pixels around it.
void OutlineFinder::smooth(const std::vector<Grown>& grown, ImageDepth& depth) {
  constexpr int kPasses = 8;
  constexpr float kBreak_m = 0.1f;
  std::vector<float> next(grown.size());
  for (int pass = 0; pass < kPasses; ++pass) {
    for (std::size_t i = 0; i < grown.size(); ++i) {
      const float here = *depth.at(grown[i].x, grown[i].y);
      float sum = here;
      int count = 1;
      for (const auto& [dx, dy] : kAround) {
        const int x = grown[i].x + dx, y = grown[i].y + dy;
        if (!depth.contains(x, y)) continue;
        if (const float d = *depth.at(x, y); d > 0 && std::abs(d - here) < kBreak_m)
          sum += d, ++count;
      }
      next[i] = sum / static_cast<float>(count);
    }
    for (std::size_t i = 0; i < grown.size(); ++i) *depth.at(grown[i].x, grown[i].y) = next[i];
  }
}

/// Sets what was added back, by a parabola at first and never by kClear_m, so not behind the room:
/// heads and arms turn away at their outline, and another sensor that sees such a place straight on
/// knows it better.
void OutlineFinder::turn_away(const std::vector<Grown>& grown, ImageDepth& depth) const {
  for (const Grown& g : grown) {
    float& z = *depth.at(g.x, g.y);
    const float aside_m = static_cast<float>(g.reach) * z / static_cast<float>(depth_camera_.fx);
    const float square_m2 = 2 * kRound_m * aside_m;
    z += std::sqrt(square_m2 / (1 + square_m2 / (kClear_m * kClear_m)));
  }
}

/// Calls `f` with the place of each pixel of the plane that a square of depth pixels covers.
template <typename F>
void OutlineFinder::each_plane_pixel(int x, int y, float depth, float side_px, const F& f) const {
  const InColor at = in_color(x, y, depth);
  if (!(at.z > 0)) return;
  const float half =
      0.5f * side_px * depth / at.z * static_cast<float>(color_camera_.fx / depth_camera_.fx);
  const auto first = [&](float middle, int count) {
    const float px = std::max((middle + 0.5f - half) / kStep_px - 0.5f, 0.0f);
    return px < static_cast<float>(count) ? static_cast<int>(std::ceil(px)) : count;
  };
  const auto last = [&](float middle, int count) {
    const float px = (middle + 0.5f + half) / kStep_px - 0.5f;
    return px >= 0 ? static_cast<int>(std::min(px, static_cast<float>(count - 1))) : -1;
  };
  const int x0 = first(at.u, width_), x1 = last(at.u, width_);
  const int y0 = first(at.v, height_), y1 = last(at.v, height_);
  for (int v = y0; v <= y1; ++v)
    for (int u = x0; u <= x1; ++u) f(u, v, at.z);
}

/// Of a pixel of what moves, or was added to it.
OutlineFinder::Depth OutlineFinder::kind_of(const Input& in, int x, int y) {
  if (!(*in.cleaned.at(x, y) > 0)) return Depth::edge;
  if (!*in.foreign.at(x, y)) return Depth::kept;
  const bool is_beside_room =
      any_around(in.measured, x, y, [&](int u, int v) { return is_room(in, u, v); });
  return is_beside_room ? Depth::edge : Depth::moving;
}

/// What moves, into an empty plane.
void OutlineFinder::draw_moving(const Input& in, const ImageDepth& depth, DepthPlane& plane) const {
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      const float z = *depth.at(x, y);
      if (!(z > 0)) continue;
      const Depth what = kind_of(in, x, y);
      each_plane_pixel(x, y, z, kOverlap, [&](int u, int v, float z_color) {
        if (z_color < *plane.nearest.at(u, v))
          *plane.nearest.at(u, v) = z_color, *plane.what.at(u, v) = what;
      });
    }
}

/// The room around it, where it is nearer: in the blocks that are `near`.
void OutlineFinder::draw_room(const Input& in, const ImageDepth& depth, const ImageMask& near,
                              DepthPlane& plane) const {
  constexpr int kEvery_px = 2;  // it has no outline here
  for (int y = 0; y < depth.height; y += kEvery_px)
    for (int x = 0; x < depth.width; x += kEvery_px) {
      if (*depth.at(x, y) > 0 || !is_room(in, x, y)) continue;
      each_plane_pixel(
          x, y, *in.measured.at(x, y), kOverlap * kEvery_px, [&](int u, int v, float z_color) {
            if (*near.at(u / kBlock_px, v / kBlock_px) && z_color < *plane.nearest.at(u, v))
              *plane.nearest.at(u, v) = z_color, *plane.what.at(u, v) = Depth::still;
          });
    }
}

/// The blocks of the plane within kNearBlocks of what moves and is not the room.
ImageMask OutlineFinder::near_blocks(const DepthPlane& plane) {
  const Image<Depth, 1>& what = plane.what;
  ImageMask out((what.width + kBlock_px - 1) / kBlock_px,
                (what.height + kBlock_px - 1) / kBlock_px);
  for (int y = 0; y < what.height; ++y)
    for (int x = 0; x < what.width; ++x) {
      if (*what.at(x, y) < Depth::edge) continue;
      const int column = x / kBlock_px, row = y / kBlock_px;
      for (int v = std::max(row - kNearBlocks, 0); v <= std::min(row + kNearBlocks, out.height - 1);
           ++v)
        for (int u = std::max(column - kNearBlocks, 0);
             u <= std::min(column + kNearBlocks, out.width - 1); ++u)
          *out.at(u, v) = 1;
      x = (column + 1) * kBlock_px - 1;  // the block's other pixels of this row add nothing
    }
  return out;
}

/// Alpha: what moves stays; beside it, what looks like the room goes.
ImageMask OutlineFinder::decide(PlateDifference& colors, const DepthPlane& plane,
                                const ImageMask& near) const {
  ImageMask out(width_, height_, 1), is_fixed(width_, height_, 1);
  each_pixel_of(near, width_, height_, [&](int x, int y) {
    const Depth depth = *plane.what.at(x, y);
    if (depth == Depth::moving || depth == Depth::kept) return;
    const PlateColor color = colors.at(x, y);
    *is_fixed.at(x, y) = 0;
    *out.at(x, y) = color == PlateColor::different || color == PlateColor::unknown ||
                    (color == PlateColor::dark && depth != Depth::still) ||
                    (color == PlateColor::unsure && depth == Depth::edge);
  });
  remove_specks(near, is_fixed, out);
  return out;
}

}  // namespace mr::still
