#include "mr/baseline/depth_video.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "mr/core/parallel.h"

namespace mr::baseline {
namespace {

constexpr int kLevels = 219;        // of luma in limited range
constexpr int kFirst = 32;          // the nearest depth; below lies what is invalid
constexpr int kLeastValid = 26;     // coding noise stays below this distance from kFirst
constexpr double kPeriod_m = 1.0;   // of the triangle wave
constexpr double kTolerance = 2.5;  // steps that the halves may differ by
constexpr std::size_t kRowsAtOnce = 16;

/// Grey that the encoder turns into this level of luma.
std::uint8_t grey(double level) {
  const double whole = std::clamp(std::round(level), 0.0, static_cast<double>(kLevels));
  return static_cast<std::uint8_t>(std::lround(whole * 255 / kLevels));
}
float level_of(const std::uint8_t* pixel) {
  return static_cast<float>(pixel[1]) * kLevels / 255.0f;
}

double step_m(const DepthRange& range) { return (range.far_m - range.near_m) / (kLevels - kFirst); }

/// The wave, 0..kLevels.
double wave(double z) {
  const double phase = z / kPeriod_m - std::floor(z / kPeriod_m);
  return kLevels * (phase < 0.5 ? 2 * phase : 2 - 2 * phase);
}

void fill(ImageRgb& picture, int x, int y, std::uint8_t value) {
  std::fill_n(picture.at(x, y), 3, value);
}

/// The depth nearest to `near_z` at which the wave has this level.
double unfold(double level, double near_z) {
  const double within = std::clamp(level / kLevels, 0.0, 1.0) * kPeriod_m / 2;
  const double k = std::floor(near_z / kPeriod_m);
  double best = std::numeric_limits<double>::infinity();
  for (int i = -1; i <= 1; ++i)
    for (const double z : {(k + i) * kPeriod_m + within, (k + i + 1) * kPeriod_m - within})
      if (std::abs(z - near_z) < std::abs(best - near_z)) best = z;
  return best;
}

/// The upper half around a pixel, averaged over pairs on opposite sides that lie on one surface
/// with it: the surface is smooth, coding noise is not. -1 where few pixels are on its surface:
/// that is an edge, or noise.
float smooth_level(const ImageRgb& picture, int x, int y, int width, int height) {
  constexpr int kReach = 2, kFewest = 6;
  constexpr float kSameSurface = 3;
  const float own = level_of(picture.at(x, y));
  const auto on_surface = [&](int i, int j, float& level) {
    if (i < 0 || j < 0 || i >= width || j >= height) return false;
    level = level_of(picture.at(i, j));
    return std::abs(level - own) <= kSameSurface;
  };
  float sum = own;
  int averaged = 1, found = 0;
  for (int j = 0; j <= kReach; ++j)
    for (int i = j == 0 ? 1 : -kReach; i <= kReach; ++i) {
      float here = 0, opposite = 0;
      const bool a = on_surface(x + i, y + j, here), b = on_surface(x - i, y - j, opposite);
      found += a + b;
      if (a && b) sum += here + opposite, averaged += 2;
    }
  return found < kFewest ? -1 : sum / static_cast<float>(averaged);
}

}  // namespace

ImageRgb depth_to_picture(const ImageDepth& depth, const DepthRange& range) {
  ImageRgb out(depth.width, 2 * depth.height);
  parallel_for(depth.height, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const float* const row = depth.row(y);
      const float* const first =
          std::find_if(row, row + depth.width, [](float z) { return z > 0; });
      std::uint8_t beside = first == row + depth.width ? std::uint8_t{0} : grey(wave(*first));
      for (int x = 0; x < depth.width; ++x) {
        const bool valid = row[x] > 0;
        const double z = std::clamp<double>(row[x], range.near_m, range.far_m);
        if (valid) fill(out, x, y, grey(kFirst + (z - range.near_m) / step_m(range)));
        if (valid) beside = grey(wave(z));
        fill(out, x, y + depth.height, beside);
      }
    }
  });
  return out;
}

ImageDepth picture_to_depth(const ImageRgb& picture, int width, int height,
                            const DepthRange& range) {
  MR_ASSERT(picture.width >= width && picture.height >= 2 * height);
  ImageDepth out(width, height);
  parallel_for(height, kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < width; ++x) {
        if (level_of(picture.at(x, y)) < kLeastValid) continue;
        const float level = smooth_level(picture, x, y, width, height);
        if (level < kLeastValid) continue;
        const double coarse = range.near_m + (level - kFirst) * step_m(range);
        const double z = unfold(level_of(picture.at(x, y + height)), coarse);
        if (std::abs(z - coarse) > kTolerance * step_m(range)) continue;
        *out.at(x, y) = static_cast<float>(std::clamp(z, range.near_m, range.far_m));
      }
  });
  return out;
}

}  // namespace mr::baseline
