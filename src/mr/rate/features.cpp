#include "mr/rate/features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::rate {
namespace {

constexpr int kN = kFeatureBlock;
using Block = std::array<std::array<double, kN>, kN>;  // [row][column]

struct Tables {
  Block basis;   // [pixel][frequency] of the orthonormal DCT-II
  Block weight;  // [j - 1][i - 1]
};

Tables make_tables() {
  Tables tables;
  for (int x = 0; x < kN; ++x)
    for (int u = 0; u < kN; ++u) {
      const double norm = std::sqrt((u == 0 ? 1.0 : 2.0) / kN);
      tables.basis[x][u] = norm * std::cos(std::numbers::pi * (2 * x + 1) * u / (2.0 * kN));
    }
  for (int j = 1; j <= kN; ++j)
    for (int i = 1; i <= kN; ++i) {
      const double part = i * j / static_cast<double>(kN * kN);
      tables.weight[j - 1][i - 1] = std::exp(part * part - 1);
    }
  tables.weight[0][0] = 0;
  return tables;
}

const Tables& tables() {
  static const Tables made = make_tables();
  return made;
}

/// aᵀ b.
Block transposed_product(const Block& a, const Block& b) {
  Block result{};
  for (int row = 0; row < kN; ++row)
    for (int k = 0; k < kN; ++k)
      for (int column = 0; column < kN; ++column) result[row][column] += a[k][row] * b[k][column];
  return result;
}

double block_energy(const Image<float, 1>& plane, int x0, int y0) {
  // Less the corner: that moves only DCT(0, 0), which does not count, and a flat block is exactly
  // 0.
  const double corner = *plane.at(x0, y0);
  Block pixels;
  for (int y = 0; y < kN; ++y)
    for (int x = 0; x < kN; ++x) pixels[y][x] = *plane.at(x0 + x, y0 + y) - corner;
  const Tables& t = tables();
  const Block dct = transposed_product(transposed_product(pixels, t.basis), t.basis);  // [j][i]
  double energy = 0;
  for (int j = 0; j < kN; ++j)
    for (int i = 0; i < kN; ++i) energy += t.weight[j][i] * std::abs(dct[j][i]);
  return energy;
}

}  // namespace

double dct_energy(const Image<float, 1>& plane) {
  const std::size_t columns = plane.width / kN, rows = plane.height / kN;
  if (columns * rows == 0) return 0;
  std::vector<double> energies(columns * rows);
  parallel_for(energies.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b)
      energies[b] = block_energy(plane, static_cast<int>(b % columns) * kN,
                                 static_cast<int>(b / columns) * kN);
  });
  return std::accumulate(energies.begin(), energies.end(), 0.0) / energies.size();
}

double temporal_dct_energy(const Image<float, 1>& before, const Image<float, 1>& now) {
  MR_ASSERT(before.width == now.width && before.height == now.height);
  Image<float, 1> difference = now;
  for (std::size_t i = 0; i < difference.data.size(); ++i) difference.data[i] -= before.data[i];
  return dct_energy(difference);
}

Image<float, 1> luma_plane(const ImageRgb& picture) {
  Image<float, 1> plane(picture.width, picture.height);
  for (std::size_t i = 0; i < plane.data.size(); ++i) {
    const std::uint8_t* rgb = picture.data.data() + 3 * i;
    plane.data[i] = 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
  }
  return plane;
}

Image<float, 1> depth_plane(const ImageDepth& depth) {
  const auto valid = [](float depth_m) { return std::isfinite(depth_m) && depth_m > 0; };
  Image<float, 1> plane(depth.width, depth.height);
  const auto first = std::find_if(depth.data.begin(), depth.data.end(), valid);
  float row_begin_m = first == depth.data.end() ? 0 : *first;
  for (int y = 0; y < depth.height; ++y) {
    float last_m = row_begin_m;
    for (int x = 0; x < depth.width; ++x) {
      if (valid(*depth.at(x, y))) last_m = *depth.at(x, y);
      *plane.at(x, y) = last_m * 1000;
      if (x == 0) row_begin_m = last_m;
    }
  }
  return plane;
}

FeaturePlanes feature_planes(const Frame& frame) {
  return {luma_plane(frame.color), depth_plane(frame.depth)};
}

SceneFeatures scene_features(const FeaturePlanes& before, const FeaturePlanes& now) {
  return {dct_energy(now.color), temporal_dct_energy(before.color, now.color),
          dct_energy(now.depth), temporal_dct_energy(before.depth, now.depth)};
}

}  // namespace mr::rate
