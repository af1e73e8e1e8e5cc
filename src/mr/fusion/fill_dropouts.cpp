#include "mr/fusion/fill_dropouts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr float kFillGrazing =
    0.26f;  // sine of the least angle between ray and a connected surface
constexpr float kFillSigmas = 5;
constexpr float kSlopeSigmas = 12;  // largest difference of slopes within one surface

/// From a pixel to its neighbour in one direction.
struct ScanDirection {
  std::ptrdiff_t step;
  float slope;  ///< steepest surface: change of inverse depth a step / inverse depth
};

/// A straight line across a gap.
struct GapLine {
  float middle = 0;  ///< inverse depth at the pixel; 0: no line
  float apart = 0;   ///< difference of its ends
};

/// Whether the surfaces on both sides continue across the gap: the slope of the line lies between
/// their slopes, within noise. `before`, `after`: the pixels next to its ends; 0: invalid.
bool leads_across(float before, float a, float b, float after, float steps, float noise) {
  if (before <= 0 || after <= 0) return true;
  const float one = a - before, other = after - b, across = (b - a) / steps;
  return across >= std::min(one, other) - noise && across <= std::max(one, other) + noise;
}

/// Limits of the gaps that are filled.
struct Limits {
  int most_px;
  bool is_exact;
  InverseSigma sigma;
};

GapLine gap_line(const float* p, const ScanDirection& direction, const Limits& limits) {
  int i = 1, j = 1;
  while (i <= limits.most_px && p[-i * direction.step] <= 0) ++i;
  if (i > limits.most_px) return {};
  const int most = limits.most_px + 1 - i;
  while (j <= most && p[j * direction.step] <= 0) ++j;
  if (j > most) return {};
  const float a = p[-i * direction.step], b = p[j * direction.step];
  const auto steps = static_cast<float>(i + j);
  const float middle = (a * static_cast<float>(j) + b * static_cast<float>(i)) / steps;
  const float apart = std::abs(a - b), noise = limits.sigma(middle);
  if (apart > direction.slope * steps * middle + kFillSigmas * noise) return {};
  if (limits.is_exact && !leads_across(p[-(i + 1) * direction.step], a, b,
                                       p[(j + 1) * direction.step], steps, kSlopeSigmas * noise))
    return {};
  return {middle, apart};
}

void fill_row(const RayGrid& grid, const RaySpacing& rays, int y, const Limits& limits,
              float* out) {
  const float across = rays.across_rad[y] / kFillGrazing;
  const float down =
      std::max(std::abs(rays.down_rad(y - 1)), std::abs(rays.down_rad(y))) / kFillGrazing;
  const std::ptrdiff_t next = grid.row(y + 1) - grid.row(y);
  const std::array<ScanDirection, 4> directions{
      {{1, across}, {next, down}, {next + 1, across + down}, {next - 1, across + down}}};
  const std::size_t used = rays.rows_touch ? directions.size() : 1;
  const float* const in = grid.row(y);
  for (int x = 0; x < grid.width(); ++x) {
    if (in[x] > 0) continue;
    GapLine best;
    for (std::size_t i = 0; i < used; ++i) {
      const GapLine found = gap_line(in + x, directions[i], limits);
      if (found.middle > 0 && (best.middle == 0 || found.apart < best.apart)) best = found;
    }
    out[x] = best.middle;
  }
}

}  // namespace

RayGrid fill_dropouts(const RayGrid& grid, const RaySpacing& rays, const Precision& precision,
                      int most_px, bool is_exact) {
  RayGrid out = grid;
  const Limits limits{std::min(most_px, RayGrid::kMargin - 1), is_exact, InverseSigma(precision)};
  parallel_for(grid.height(), 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      fill_row(grid, rays, y, limits, out.row(y));
      out.wrap(y);
    }
  });
  return out;
}

}  // namespace mr::fusion
