#include "mr/fusion/mixed_pixels.h"

#include <algorithm>
#include <cmath>

#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr float kJumpGrazing = 0.26f;  // sine of the angle to the ray; a smaller angle is a jump
constexpr float kSteeper = 5.2f;       // three degrees: a steeper line is not a surface
constexpr float kJumpSigmas = 4;       // of one pixel: noise tolerance of a step
constexpr float kMostStretch = 4;      // largest extrapolation, for unevenly spaced rows

/// The two neighbours of each pixel on one side, for extrapolating a line through them.
struct Side {
  const float *near, *far;
  float stretch;  ///< step to the pixel / step between the neighbours
};

/// One of the directions in which pixels are compared.
struct Axis {
  Side one, other;
  float slope;  ///< steepest surface: change of inverse depth between neighbours / inverse depth
};

/// Largest changes of inverse depth that are no jump, over one and two pixels, and that of the
/// steepest surface.
struct Steps {
  float one, two, steepest;
};

struct SideTests {
  int nearer, nearer2, farther, farther2, goes_on;  ///< 0 or 1; as wide as a float
};

/// Tests the neighbours on one side of pixel `p`; suffix 2: up to two pixels away. Branch-free, so
/// that it is vectorised.
inline SideTests test_side(float p, float a, float b, float stretch, const Steps& most) {
  const float rise = a - p, rise2 = b - p;
  const float off = std::abs(rise + (a - b) * stretch);
  SideTests out;
  out.nearer = rise > most.one;
  out.nearer2 = out.nearer | (rise2 > most.two);
  out.farther = (-rise > most.one) & (a > 0);
  out.farther2 = out.farther | ((-rise2 > most.two) & (b > 0));
  out.goes_on = (off <= most.one) & (std::abs(a - b) <= most.steepest) & (a > 0) & (b > 0);
  return out;
}

inline int hangs_between(const SideTests& l, const SideTests& r) {
  const int between = (l.nearer & r.farther2) | (l.nearer2 & r.farther) | (r.nearer & l.farther2) |
                      (r.nearer2 & l.farther);
  return between & (1 ^ (l.goes_on | r.goes_on));
}

void drop_along(const Axis& axis, const float* in, int width, InverseSigma sigma, float* out) {
  const float *const a1 = axis.one.near, *const a2 = axis.one.far;
  const float *const b1 = axis.other.near, *const b2 = axis.other.far;
  const float one = axis.one.stretch, other = axis.other.stretch, slope = axis.slope;
  for (int x = 0; x < width; ++x) {
    const float p = in[x], rise = slope * p;
    const float noise = kJumpSigmas * sigma(p);
    const Steps most{rise + noise, 2 * rise + noise, kSteeper * rise + noise};
    const SideTests l = test_side(p, a1[x], a2[x], one, most);
    const SideTests r = test_side(p, b1[x], b2[x], other, most);
    out[x] *= static_cast<float>(1 - hangs_between(l, r));
  }
}

float stretch(float to_pixel_rad, float between_rad) {
  if (between_rad == 0 || to_pixel_rad == 0) return 1;
  return std::clamp(to_pixel_rad / between_rad, -kMostStretch, kMostStretch);
}

Axis down(const RayGrid& grid, const RaySpacing& rays, int y) {
  const float above = rays.down_rad(y - 1), below = rays.down_rad(y);
  const float apart = std::max(std::abs(above), std::abs(below));
  return {{grid.row(y - 1), grid.row(y - 2), stretch(above, rays.down_rad(y - 2))},
          {grid.row(y + 1), grid.row(y + 2), stretch(below, rays.down_rad(y + 1))},
          apart / kJumpGrazing};
}

Axis across(const RayGrid& grid, const RaySpacing& rays, int y) {
  const float* const in = grid.row(y);
  return {{in - 1, in - 2, 1}, {in + 1, in + 2, 1}, rays.across_rad[y] / kJumpGrazing};
}

}  // namespace

RayGrid drop_mixed_pixels(const RayGrid& grid, const RaySpacing& rays, const Precision& precision) {
  RayGrid out = grid;
  const InverseSigma sigma(precision);
  parallel_for(grid.height(), 32, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      drop_along(across(grid, rays, y), grid.row(y), grid.width(), sigma, out.row(y));
      if (rays.rows_touch)
        drop_along(down(grid, rays, y), grid.row(y), grid.width(), sigma, out.row(y));
      out.wrap(y);
    }
  });
  return out;
}

}  // namespace mr::fusion
