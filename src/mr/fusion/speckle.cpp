#include "mr/fusion/speckle.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr float kLinkGrazing =
    0.05f;                        // sine of the angle to the ray at which surfaces still connect
constexpr float kLinkSigmas = 6;  // of one pixel: noise tolerance of a step

/// Whether each pixel is connected to the one to its left and the one above.
struct Links {
  ImageMask left, up;
};

/// Branch-free, so that it is vectorised.
void link_row(const float* row, const float* other, int width, float slope, InverseSigma sigma,
              std::uint8_t* out) {
  for (int x = 0; x < width; ++x) {
    const float a = row[x], b = other[x];
    const float near = std::max(a, b), far = std::min(a, b);
    const float step = slope * near + kLinkSigmas * sigma(near);
    out[x] = static_cast<std::uint8_t>((near - far <= step) & (far > 0));
  }
}

Links link(const RayGrid& grid, const RaySpacing& rays, InverseSigma sigma) {
  Links out{ImageMask(grid.width(), grid.height()), ImageMask(grid.width(), grid.height())};
  parallel_for(grid.height(), 64, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const float* const row = grid.row(y);
      link_row(row, row - 1, grid.width(), rays.across_rad[y] / kLinkGrazing, sigma,
               out.left.row(y));
      const float down = std::abs(rays.down_rad(y - 1)) / kLinkGrazing;
      link_row(row, grid.row(y - 1), grid.width(), down, sigma, out.up.row(y));
    }
  });
  return out;
}

/// A run of connected pixels in one row.
struct Run {
  int y, begin, end;
  int region;  ///< union-find parent: an earlier run of the region, or itself
  int pixels;  ///< size of the region, stored at its first run
};

class RunComponents {
 public:
  explicit RunComponents(int width) : above_(width, -1), here_(width, -1) {}

  void add_row(const float* row, int width, int y, const std::uint8_t* left, const std::uint8_t* up,
               bool around) {
    std::swap(above_, here_);
    int last_above = -1;
    for (int x = 0; x < width; ++x) {
      if (!(row[x] > 0)) continue;
      if (x == 0 || !left[x]) {
        const int run = static_cast<int>(runs_.size());
        runs_.push_back({y, x, x, run, 0});
        last_above = -1;
      }
      Run& run = runs_.back();
      run.end = x + 1;
      const int id = here_[x] = static_cast<int>(runs_.size()) - 1;
      if (up[x] && above_[x] != last_above) join(id, last_above = above_[x]);
    }
    if (around && left[0]) join(here_[0], here_[width - 1]);
  }

  /// Clears the runs of small regions.
  void drop_small(RayGrid& grid, int least_px) {
    for (std::size_t i = 0; i < runs_.size(); ++i)
      runs_[first(static_cast<int>(i))].pixels += runs_[i].end - runs_[i].begin;
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      if (runs_[first(static_cast<int>(i))].pixels >= least_px) continue;
      float* const row = grid.row(runs_[i].y);
      std::fill(row + runs_[i].begin, row + runs_[i].end, 0.0f);
    }
  }

 private:
  int first(int run) {
    while (runs_[run].region != run) run = runs_[run].region = runs_[runs_[run].region].region;
    return run;
  }

  void join(int a, int b) {
    a = first(a), b = first(b);
    runs_[std::max(a, b)].region = std::min(a, b);
  }

  std::vector<Run> runs_;
  std::vector<int> above_, here_;  // [W] run of each valid pixel of two rows
};

}  // namespace

void drop_speckle(RayGrid& grid, const RaySpacing& rays, const Precision& precision, int least_px) {
  if (grid.width() < 1) return;
  const Links links = link(grid, rays, InverseSigma(precision));
  RunComponents regions(grid.width());
  for (int y = 0; y < grid.height(); ++y)
    regions.add_row(grid.row(y), grid.width(), y, links.left.row(y), links.up.row(y),
                    grid.around());
  regions.drop_small(grid, least_px);
  for (int y = 0; y < grid.height(); ++y) grid.wrap(y);
}

}  // namespace mr::fusion
