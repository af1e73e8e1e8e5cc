#include "mr/still/outline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <tuple>
#include <utility>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/still/tiles.h"

namespace mr::still {
namespace {

constexpr int kAlphaStep_px = AlphaPlane::kStep_px;
constexpr int kBlock_px = kColorTile_px / kAlphaStep_px;  // of the plane
constexpr int kSameLevels = 10, kDifferentLevels = 26;  // of 255, in the channel that differs most
constexpr int kStaysLevels = 17;        // what was different in the capture before stays so above
constexpr int kDarkLevels = 48;         // hair and black cloth before something dark
constexpr float kDarkestShadow = 0.6f;  // of the light
constexpr float kClear_m = 0.08f;   // between what moves and the room behind, to tell them apart
constexpr int kThin_px = 4;         // colour may add before depth of the room
constexpr double kHair_m = 0.22;    // and where there is no depth
constexpr int kMostlyAround = 5;    // of eight neighbours: these say what colour does not
constexpr float kBackwards = 0.4f;  // a head is round: what is added turns away from the camera
constexpr int kNearBlocks = 2;

constexpr std::array<std::pair<int, int>, 8> kAround{
    {{-1, -1}, {0, -1}, {1, -1}, {-1, 0}, {1, 0}, {-1, 1}, {0, 1}, {1, 1}}};

/// Whether a depth pixel measures what does not move.
bool is_room(const OutlineFinder::Input& in, int x, int y) {
  return *in.measured.at(x, y) > 0 && !*in.moving.at(x, y);
}

/// The mean of a square of pixels, as far as the picture reaches.
std::array<int, 3> mean_of(const ImageRgb& picture, int x0, int y0) {
  const int x1 = std::min(x0 + kAlphaStep_px, picture.width),
            y1 = std::min(y0 + kAlphaStep_px, picture.height);
  std::array<int, 3> sum{};
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x)
      for (int c = 0; c < 3; ++c) sum[c] += picture.at(x, y)[c];
  for (int& s : sum) s /= (x1 - x0) * (y1 - y0);
  return sum;
}

/// How much a colour differs from a room's, which may lie in shadow.
float difference(const std::array<int, 3>& now, const std::array<float, 3>& room) {
  float both = 0, square = 0;
  for (int c = 0; c < 3; ++c) both += now[c] * room[c], square += room[c] * room[c];
  const float light = square > 0 ? std::clamp(both / square, kDarkestShadow, 1.0f) : 1;
  float most = 0;
  for (int c = 0; c < 3; ++c) most = std::max(most, std::abs(now[c] - light * room[c]));
  return most;
}

}  // namespace

OutlineFinder::OutlineFinder(const Camera& depth_camera, const Camera& color_camera,
                             const Pose& T_color_depth)
    : depth_camera_(depth_camera),
      color_camera_(color_camera),
      T_color_depth_(T_color_depth),
      width_((color_camera.width + kAlphaStep_px - 1) / kAlphaStep_px),
      height_((color_camera.height + kAlphaStep_px - 1) / kAlphaStep_px),
      was_different_(width_, height_) {
  MR_ASSERT(depth_camera.model == CameraModel::pinhole);
  MR_ASSERT(color_camera.model == CameraModel::pinhole);
}

Outline OutlineFinder::find(const Input& in) {
  const ColorPlane colors = compare(in);
  Outline out{in.cleaned, {}};
  const std::vector<Grown> grown = grow(in, colors, out.depth);
  smooth(grown, out.depth);
  out.alpha = decide(colors, draw(in, out.depth));
  return out;
}

/// What is different is remembered: it stays so for less.
OutlineFinder::ColorPlane OutlineFinder::compare(const Input& in) {
  ColorPlane out(width_, height_, Color::unknown);
  parallel_for(height_, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < width_; ++x) {
        std::uint8_t& was_different = *was_different_.at(x, y);
        if (!in.known.at(x / kBlock_px, y / kBlock_px)) {
          was_different = 0;
          continue;
        }
        const auto now = mean_of(in.color, x * kAlphaStep_px, y * kAlphaStep_px);
        const auto plate = mean_of(in.plate, x * kAlphaStep_px, y * kAlphaStep_px);
        const std::array<float, 3> room{plate[0] * in.gain.x, plate[1] * in.gain.y,
                                        plate[2] * in.gain.z};
        const float d = difference(now, room);
        was_different = d >= (was_different ? kStaysLevels : kDifferentLevels);
        const bool is_dark = std::max({now[0], now[1], now[2]}) < kDarkLevels;
        *out.at(x, y) = was_different     ? Color::different
                        : is_dark         ? Color::dark
                        : d < kSameLevels ? Color::same
                                          : Color::unsure;
      }
  });
  return out;
}

/// Of a point at a depth pixel; unknown beside the colour picture.
OutlineFinder::Color OutlineFinder::color_at(const ColorPlane& colors, int x, int y,
                                             float depth) const {
  const Vec3d ray = unproject(depth_camera_, {double(x), double(y)});
  const auto p = project(color_camera_, T_color_depth_ * (ray * double{depth}));
  if (!p) return Color::unknown;
  const double u = p->x + 0.5, v = p->y + 0.5;
  if (!(u >= 0 && v >= 0 && u < color_camera_.width && v < color_camera_.height))
    return Color::unknown;
  return *colors.at(static_cast<int>(u) / kAlphaStep_px, static_cast<int>(v) / kAlphaStep_px);
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
std::vector<OutlineFinder::Grown> OutlineFinder::grow(const Input& in, const ColorPlane& colors,
                                                      ImageDepth& depth) const {
  std::vector<Grown> edge, all;
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x)
      if (const float d = *depth.at(x, y); d > 0 && *in.foreign.at(x, y))
        edge.push_back({x, y, d, 0, 0});
  while (!edge.empty()) {
    edge = neighbours(in, depth, edge);
    std::erase_if(edge, [&](const Grown& g) {
      const bool before_room = is_room(in, g.x, g.y);
      const double most = before_room ? kThin_px : kHair_m * depth_camera_.fx / g.depth;
      if (g.reach > most) return true;
      const Color color = color_at(colors, g.x, g.y, g.depth);
      if (color == Color::different) return false;
      const bool says_no = color == Color::same || color == Color::unknown;
      return says_no || before_room || g.beside < kMostlyAround;
    });
    for (const Grown& g : edge)
      *depth.at(g.x, g.y) = g.depth + kBackwards * g.depth / static_cast<float>(depth_camera_.fx);
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

/// Calls `f` with the place of each pixel of the plane that a square of depth pixels covers.
template <typename F>
void OutlineFinder::each_plane_pixel(int x, int y, float depth, float side_px, const F& f) const {
  const Vec3d ray = unproject(depth_camera_, {double(x), double(y)});
  const Vec3d p = T_color_depth_ * (ray * double{depth});
  const auto pixel = project(color_camera_, p);
  if (!pixel) return;
  const double half = 0.5 * side_px * depth / p.z * color_camera_.fx / depth_camera_.fx;
  const auto first = [&](double middle, int last) {
    return static_cast<int>(
        std::ceil(std::clamp((middle + 0.5 - half) / kAlphaStep_px - 0.5, 0.0, double(last) + 1)));
  };
  const auto end = [&](double middle, int last) {
    return static_cast<int>(
        std::floor(std::clamp((middle + 0.5 + half) / kAlphaStep_px - 0.5, -1.0, double(last))));
  };
  const int x0 = first(pixel->x, width_ - 1), x1 = end(pixel->x, width_ - 1);
  const int y0 = first(pixel->y, height_ - 1), y1 = end(pixel->y, height_ - 1);
  for (int v = y0; v <= y1; ++v)
    for (int u = x0; u <= x1; ++u) f(u, v, static_cast<float>(p.z));
}

/// Of a pixel of what moves, or was added to it.
OutlineFinder::Depth OutlineFinder::kind_of(const Input& in, int x, int y) {
  if (!(*in.cleaned.at(x, y) > 0)) return Depth::edge;
  if (!*in.foreign.at(x, y)) return Depth::kept;
  const bool is_beside_room = std::ranges::any_of(kAround, [&](const auto& d) {
    const int u = x + d.first, v = y + d.second;
    return in.measured.contains(u, v) && is_room(in, u, v);
  });
  return is_beside_room ? Depth::edge : Depth::moving;
}

/// What depth says of the plane's pixels: the nearest counts.
OutlineFinder::DepthPlane OutlineFinder::draw(const Input& in, const ImageDepth& depth) const {
  constexpr int kStep_px = 2;       // of the room: it has no outline here
  constexpr float kOverlap = 1.2f;  // so that no gaps are left
  DepthPlane out(width_, height_, Depth::none);
  ImageDepth nearest(width_, height_, std::numeric_limits<float>::infinity());
  const auto add = [&](int x, int y, float z, float side_px, Depth what) {
    each_plane_pixel(x, y, z, side_px, [&](int u, int v, float z_color) {
      if (z_color >= *nearest.at(u, v)) return;
      *nearest.at(u, v) = z_color, *out.at(u, v) = what;
    });
  };
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x)
      if (const float z = *depth.at(x, y); z > 0) {
        add(x, y, z, kOverlap, kind_of(in, x, y));
      } else if (x % kStep_px == 0 && y % kStep_px == 0 && is_room(in, x, y)) {
        add(x, y, *in.measured.at(x, y), kOverlap * kStep_px, Depth::still);
      }
  return out;
}

/// The blocks of the plane within kNearBlocks of what moves and is not the room.
ImageMask OutlineFinder::near_blocks(const DepthPlane& depths) {
  ImageMask out((depths.width + kBlock_px - 1) / kBlock_px,
                (depths.height + kBlock_px - 1) / kBlock_px);
  for (int y = 0; y < depths.height; ++y)
    for (int x = 0; x < depths.width; ++x) {
      if (*depths.at(x, y) < Depth::edge) continue;
      const int column = x / kBlock_px, row = y / kBlock_px;
      for (int v = std::max(row - kNearBlocks, 0); v <= std::min(row + kNearBlocks, out.height - 1);
           ++v)
        for (int u = std::max(column - kNearBlocks, 0);
             u <= std::min(column + kNearBlocks, out.width - 1); ++u)
          *out.at(u, v) = 1;
    }
  return out;
}

/// A few pixels go with those around them; those that `is_fixed` stay.
ImageMask OutlineFinder::without_specks(ImageMask alpha, const ImageMask& is_fixed) {
  constexpr int kPasses = 2, kMostOfNine = 5;
  for (int pass = 0; pass < kPasses; ++pass) {
    const ImageMask raw = alpha;
    for (int y = 1; y + 1 < alpha.height; ++y)
      for (int x = 1; x + 1 < alpha.width; ++x) {
        if (*is_fixed.at(x, y)) continue;
        int ones = *raw.at(x, y);
        for (const auto& [dx, dy] : kAround) ones += *raw.at(x + dx, y + dy);
        *alpha.at(x, y) = ones >= kMostOfNine;
      }
  }
  return alpha;
}

/// Alpha: what moves stays; beside it, what looks like the room goes.
ImageMask OutlineFinder::decide(const ColorPlane& colors, const DepthPlane& depths) const {
  const ImageMask near = near_blocks(depths);
  ImageMask out(width_, height_, 1), is_fixed(width_, height_, 1);
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const Color color = *colors.at(x, y);
      const Depth depth = *depths.at(x, y);
      if (!*near.at(x / kBlock_px, y / kBlock_px) || depth == Depth::moving || depth == Depth::kept)
        continue;
      *is_fixed.at(x, y) = 0;
      *out.at(x, y) = color == Color::different || color == Color::unknown ||
                      (color == Color::dark && depth != Depth::still) ||
                      (color == Color::unsure && depth == Depth::edge);
    }
  return without_specks(std::move(out), is_fixed);
}

}  // namespace mr::still
