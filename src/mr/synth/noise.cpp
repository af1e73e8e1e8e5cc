#include "mr/synth/noise.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>

#include "mr/synth/hash.h"
#include "mr/synth/posed_camera.h"

namespace mr::synth {
namespace {

constexpr float kEdge_mm = 50, kEdgeSlope = 0.02f;  // a larger step to a neighbour is an edge
constexpr float kDarkColor = 0.015f;                // linear luminance
constexpr float kDarkLoss = 0.6f;                   // share of measurements that fail there

/// Weights of a Gaussian whose squares sum to 1: white noise keeps its deviation. Twice their
/// variance is that of the result's correlation.
std::vector<float> keeping_deviation(double correlation_px) {
  const double s = correlation_px / std::numbers::sqrt2;
  const int reach = static_cast<int>(std::ceil(3.5 * s));
  std::vector<float> weights;
  double squares = 0;
  for (int i = -reach; i <= reach; ++i) {
    weights.push_back(static_cast<float>(std::exp(-0.5 * i * i / (s * s))));
    squares += 1.0 * weights.back() * weights.back();
  }
  for (float& w : weights) w = static_cast<float>(w / std::sqrt(squares));
  return weights;
}

/// [H*W] deviation 1, correlated between pixels. Beyond the borders the white noise goes on.
std::vector<float> correlated_deviates(int width, int height, double correlation_px,
                                       std::uint64_t seed) {
  const std::vector<float> weights = keeping_deviation(correlation_px);
  const int reach = static_cast<int>(weights.size() / 2), wide = width + 2 * reach,
            high = height + 2 * reach;
  std::vector<float> across(static_cast<std::size_t>(width) * high);  // smoothed along rows
  for_rows(high, [&](int y) {
    std::vector<float> white(wide);
    for (int x = 0; x < wide; ++x)
      white[x] = normal_deviate(mix(seed + static_cast<std::uint64_t>(y) * wide + x));
    for (int x = 0; x < width; ++x) {
      float sum = 0;
      for (std::size_t i = 0; i < weights.size(); ++i) sum += weights[i] * white[x + i];
      across[static_cast<std::size_t>(y) * width + x] = sum;
    }
  });
  std::vector<float> out(static_cast<std::size_t>(width) * height);
  for_rows(height, [&](int y) {
    for (std::size_t i = 0; i < weights.size(); ++i)
      for (int x = 0; x < width; ++x)
        out[static_cast<std::size_t>(y) * width + x] += weights[i] * across[(y + i) * width + x];
  });
  return out;
}

/// One pixel's measurement in mm, 0 where it fails. `deviate`: null for one of its own.
float noisy(const DepthTruth& truth, std::size_t pixel, const DepthNoise& noise,
            std::uint64_t frame_seed, const float* deviate) {
  float z = truth.z_mm[pixel];
  const std::uint8_t flags = truth.flags[pixel];
  if (z <= 0 || (flags & DepthTruth::kGrazing) != 0) return 0;
  const std::uint64_t hash = mix(frame_seed + pixel);
  if (flags != 0) {
    const std::uint64_t other = mix(hash);
    if ((flags & DepthTruth::kDark) != 0 && unit(other) < kDarkLoss) return 0;
    if ((flags & DepthTruth::kEdge) != 0 && (other & 1) != 0)
      z += (truth.beyond_mm[pixel] - z) * (0.15f + 0.7f * unit(mix(other)));
  }
  const float z_m = z * 0.001f;
  const float sigma_mm = 1000 * static_cast<float>(noise.precision.base_m) +
                         1000 * static_cast<float>(noise.precision.per_m2) * z_m * z_m;
  return z + sigma_mm * static_cast<float>(noise.factor) *
                 (deviate != nullptr ? *deviate : normal_deviate(hash));
}

}  // namespace

// From integers only: the count of set bits is binomial with deviation 4, a fraction smooths its
// steps.
float normal_deviate(std::uint64_t hash) {
  constexpr float kScale = 0.24935f;  // 1 / sqrt(16 + 1/12)
  const float fraction = static_cast<float>((hash * 0x9E3779B97F4A7C15ull) >> 48) * (1.0f / 65536);
  return (static_cast<float>(std::popcount(hash)) - 32.5f + fraction) * kScale;
}

DepthTruth::DepthTruth(int w, int h)
    : width(w),
      height(h),
      z_mm(static_cast<std::size_t>(w) * h),
      beyond_mm(z_mm.size()),
      flags(z_mm.size()) {}

void find_edges(DepthTruth& truth, Rect part) {
  const int x1 = std::min(part.x + part.width, truth.width);
  const int y1 = std::min(part.y + part.height, truth.height);
  constexpr std::array<Vec2i, 4> kBesides{{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};
  const std::span besides = std::span(kBesides).first(truth.rows_touch ? 4 : 2);
  for (int y = std::max(part.y, 0); y < y1; ++y)
    for (int x = std::max(part.x, 0); x < x1; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * truth.width + x;
      const float here = truth.z_mm[pixel];
      float beyond = here;
      for (const Vec2i side : besides) {
        const int i = x + side.x, j = y + side.y;
        if (i < 0 || j < 0 || i >= truth.width || j >= truth.height) continue;
        const float there = truth.z_mm[static_cast<std::size_t>(j) * truth.width + i];
        if (there > 0 && std::abs(there - here) > std::abs(beyond - here)) beyond = there;
      }
      const bool edge = std::abs(beyond - here) > std::max(kEdge_mm, kEdgeSlope * here);
      truth.beyond_mm[pixel] = beyond;
      truth.flags[pixel] = static_cast<std::uint8_t>((truth.flags[pixel] & ~DepthTruth::kEdge) |
                                                     (edge ? DepthTruth::kEdge : 0));
    }
}

bool is_dark(Vec3f color) {
  return 0.2126f * color.x + 0.7152f * color.y + 0.0722f * color.z < kDarkColor;
}

void measure(const DepthTruth& truth, const DepthNoise& noise, std::uint64_t frame_seed,
             std::span<std::uint16_t> out) {
  MR_ASSERT(out.size() == truth.z_mm.size());
  const float near = static_cast<float>(noise.near_m * 1000),
              far = std::min(static_cast<float>(noise.far_m * 1000), 65534.0f);
  std::vector<float> deviates;
  if (noise.on && noise.correlation_px > 0)
    deviates =
        correlated_deviates(truth.width, truth.height, noise.correlation_px, mix(frame_seed, 0xC0));
  for_rows(truth.height, [&](int y) {
    const std::size_t begin = static_cast<std::size_t>(y) * truth.width;
    for (std::size_t i = begin; i < begin + truth.width; ++i) {
      const float* deviate = deviates.empty() ? nullptr : &deviates[i];
      const float z = noise.on ? noisy(truth, i, noise, frame_seed, deviate) : truth.z_mm[i];
      const float whole = std::floor(z + 0.5f);
      out[i] = whole >= near && whole <= far ? static_cast<std::uint16_t>(whole) : 0;
    }
  });
}

}  // namespace mr::synth
