#include "mr/fusion/smooth_depth.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr float kRange = 5;  // sigmas
constexpr float kSlant = 3;  // in ranges; a larger difference is a depth edge
constexpr std::array<float, 4> kNear{1, 0.97f, 0.875f, 0.72f};  // by distance in pixels

struct Sum {
  float value, weight;
};

/// Similarity weight, 0..1, of two inverse depths that differ by `off` ranges. Branch-free, so that
/// it is vectorised.
inline float alike(float off, int valid) {
  const float unlike = off * off;
  return (1 - unlike) * (1 - unlike) * static_cast<float>(valid & (unlike < 1));
}

inline float either(float a, float b) { return a + b - a * b; }

/// Adds two opposite neighbours of pixel p, weighted by their similarity to p, or by that of their
/// mean if it is larger and they do not differ too much: on a slanted surface the mean equals p.
inline void add(float p, float a, float b, float per_range, float near, Sum& sum) {
  const float off_a = (a - p) * per_range, off_b = (b - p) * per_range;
  const int slant = (std::abs(off_a) < kSlant) & (std::abs(off_b) < kSlant);
  const float both = alike(0.5f * (off_a + off_b), (a > 0) & (b > 0) & slant);
  const float wa = near * either(alike(off_a, a > 0), both);
  const float wb = near * either(alike(off_b, b > 0), both);
  sum.value += wa * a + wb * b;
  sum.weight += wa + wb;
}

/// Smooths a row; neighbours lie `step` floats apart.
void smooth_row(const float* in, std::ptrdiff_t step, int width, InverseSigma sigma, float* out) {
  for (int x = 0; x < width; ++x) {
    const float* const n = in + x;
    const float p = *n, per_range = 1 / (kRange * sigma(p));
    Sum sum{p, 1};
    add(p, n[-step], n[step], per_range, kNear[1], sum);
    add(p, n[-2 * step], n[2 * step], per_range, kNear[2], sum);
    add(p, n[-3 * step], n[3 * step], per_range, kNear[3], sum);
    out[x] = static_cast<float>((p > 0) & (sum.weight > 0)) * (sum.value / sum.weight);
  }
}

RayGrid smooth_along(const RayGrid& grid, std::ptrdiff_t step, InverseSigma sigma) {
  RayGrid out(grid.width(), grid.height(), grid.around());
  parallel_for(grid.height(), 32, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      smooth_row(grid.row(y), step, grid.width(), sigma, out.row(y));
      out.wrap(y);
    }
  });
  return out;
}

}  // namespace

RayGrid smooth_depth(const RayGrid& grid, const RaySpacing& rays, const Precision& precision) {
  const InverseSigma sigma(precision);
  RayGrid out = smooth_along(grid, 1, sigma);
  return rays.rows_touch ? smooth_along(out, out.row(1) - out.row(0), sigma) : out;
}

ImageDepth smooth_depth(const ImageDepth& depth, const Precision& precision) {
  const RaySpacing rays(depth.width, depth.height);
  return to_depth(smooth_depth(to_grid(depth, rays), rays, precision), rays, nullptr);
}

}  // namespace mr::fusion
