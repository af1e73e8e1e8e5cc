#include "mr/fusion/pinhole_planes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/fusion/ray_grid.h"

namespace mr::fusion {
namespace {

/// Tangent of the angle between ray and surface; below it, neighbours alone do not make a surface.
constexpr float kSteepest = 0.3f;

/// Of a pixel's inverse depth: a line that passes nearer to zero is none.
constexpr float kLeastInverse = 0.5f;

/// What makes one surface of pixels in a row: each of their steps is about the mean one.
struct LineRule {
  int pixels;
  float least, most;  ///< of the mean step
  int inside;         ///< pixels that must lie on both sides of one that is to be on the line
};
constexpr std::array<LineRule, 2> kLines{{{6, 0.1f, 1.9f, 0}, {4, 0.75f, 1.25f, 1}}};

/// Inverse depth; every plane is an affine function of the pixel.
RayGrid inverse_depth(const FrameView& view) {
  RayGrid out(view.width, view.height, false);
  parallel_for(view.height, 32, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const float* const depth = view.row(y);
      float* const row = out.row(y);
      for (int x = 0; x < view.width; ++x) row[x] = depth[x] > 0 ? 1 / depth[x] : 0.0f;
    }
  });
  return out;
}

/// A line at a pixel: inverse depth, and its change per pixel.
struct PixelLine {
  float inverse, slope;
};

/// The line through pixels that lie `next` floats apart, at one of them; none: they are no surface.
std::optional<PixelLine> line_through(const float* first, std::ptrdiff_t next, int at,
                                      const LineRule& rule) {
  const auto steps = static_cast<float>(rule.pixels - 1);
  const float last = first[(rule.pixels - 1) * next], mean = (last - first[0]) / steps;
  if (first[0] <= 0 || last <= 0 || mean == 0) return std::nullopt;
  float moment = 0.5f * steps * (last - first[0]), sum = first[0] + last;
  for (int i = 1; i < rule.pixels; ++i) {
    const float here = first[i * next], step = (here - first[(i - 1) * next]) / mean;
    if (here <= 0 || step < rule.least || step > rule.most) return std::nullopt;
    if (i < rule.pixels - 1) moment += here * (static_cast<float>(i) - 0.5f * steps), sum += here;
  }
  const auto n = static_cast<float>(rule.pixels);
  const float slope = moment * 12 / (n * (n * n - 1));  // least squares
  return PixelLine{sum / n + slope * (static_cast<float>(at) - 0.5f * steps), slope};
}

/// The line over a grazing surface that has `pixel` nearest its middle.
std::optional<PixelLine> grazing_line(const float* pixel, std::ptrdiff_t next) {
  for (const LineRule& rule : kLines) {
    const int half = rule.pixels / 2;
    for (int off = 0; off < half - rule.inside; ++off)
      for (const int before : {half - 1 - off, half + off})
        if (const auto line = line_through(pixel - before * next, next, before, rule)) return line;
  }
  return std::nullopt;
}

/// Slopes along one direction, per pixel.
struct Slopes {
  explicit Slopes(int width) : slope(width), moved(width), steep(width) {}
  std::vector<float> slope;
  std::vector<float> moved;         ///< from the pixel's own inverse depth to its line's
  std::vector<std::uint8_t> steep;  ///< a neighbour lies beyond kSteepest

  /// `row`: of inverse depths, whose neighbours lie `next` floats away; `angle`: between them.
  void of_row(const float* row, std::ptrdiff_t next, float angle) {
    const auto width = static_cast<int>(slope.size());
    for (int x = 0; x < width; ++x) {  // branch-free, so that it is vectorised
      const float a = row[x - next], p = row[x], b = row[x + next];
      const float before = p - a, after = b - p;
      const int steep_before = std::abs(before) * kSteepest > angle * std::min(a, p);
      const int steep_after = std::abs(after) * kSteepest > angle * std::min(p, b);
      const int has_before = (a > 0) & (1 ^ steep_before);
      const int has_after = (b > 0) & (1 ^ steep_after);
      const auto sides = static_cast<float>(has_before + has_after);
      const float sum =
          static_cast<float>(has_before) * before + static_cast<float>(has_after) * after;
      slope[x] = sum / std::max(sides, 1.0f);
      steep[x] = static_cast<std::uint8_t>(((a > 0) & steep_before) | ((b > 0) & steep_after));
    }
    for (int x = 0; x < width; ++x) {
      moved[x] = 0;
      if (!steep[x]) continue;
      if (const auto line = grazing_line(row + x, next))
        slope[x] = line->slope, moved[x] = line->inverse - row[x];
    }
  }
};

/// From slopes per pixel. The plane's equation: inverse depth is affine in the direction of
/// depth 1.
void set_row(const FrameView& view, int y, const float* inverse, const Slopes& right,
             const Slopes& down, RangePlane* planes) {
  constexpr float kLeastCosine = 0.1f;
  const float row = view.first_row + static_cast<float>(y) * view.per_pixel.y;
  const float per_right = 1 / view.per_pixel.x, per_down = 1 / view.per_pixel.y;
  for (int x = 0; x < view.width; ++x) {
    const float across = right.slope[x] * per_right, along = down.slope[x] * per_down;
    float w = inverse[x] + right.moved[x] + down.moved[x];
    if (w < kLeastInverse * inverse[x]) w = inverse[x];
    const float ahead = w - across * view.s[x] - along * row;
    const float steepness = std::sqrt(across * across + along * along + ahead * ahead);
    const float cosine = std::max(w / std::max(steepness, 1e-20f), kLeastCosine);
    const float known = w > 0 ? 1.0f : 0.0f;
    planes[x] = {w, known * right.slope[x], known * down.slope[x], w > 0 ? cosine : 1.0f};
  }
}

}  // namespace

void fit_pinhole_planes(FrameView& view) {
  const RayGrid inverse = inverse_depth(view);
  const std::ptrdiff_t below = inverse.row(1) - inverse.row(0);
  view.planes.assign(view.depth.size(), {});
  parallel_for(view.height, 16, [&](std::size_t begin, std::size_t end) {
    Slopes right(view.width), down(view.width);
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      right.of_row(inverse.row(y), 1, view.per_pixel.x);
      down.of_row(inverse.row(y), below, view.per_pixel.y);
      set_row(view, y, inverse.row(y), right, down, &view.planes[view.place(0, y)]);
    }
  });
}

}  // namespace mr::fusion
