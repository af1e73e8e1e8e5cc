#include "mr/fusion/smooth_depth.h"

#include <algorithm>
#include <vector>

#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr int kRadius = 3;

/// What is summed up for every pixel of a row.
struct Sums {
  explicit Sums(int width) : range_m(width), depth(width), weight(width) {}
  std::vector<float> range_m, depth, weight;
};

/// Adds the row `other`, moved by `du` pixels, to the sums of row `middle` with the weight `near`.
void add_row(const float* middle, const float* other, int width, int du, float near, Sums& sums) {
  const float* const range_m = sums.range_m.data();
  float* const depth = sums.depth.data();
  float* const weight = sums.weight.data();
  for (int x = std::max(0, -du); x < std::min(width, width - du); ++x) {
    const float d = other[x + du];
    const float off = (d - middle[x]) / range_m[x];
    const float unlike = off * off;
    const float alike = (1 - unlike) * (1 - unlike);
    const auto counts = static_cast<float>((d > 0) & (unlike < 1));  // no branch: vectorised
    const float w = near * alike * counts;
    depth[x] += w * d;
    weight[x] += w;
  }
}

void smooth_row(const ImageDepth& in, int y, const Precision& precision, Sums& sums, float* out) {
  const float* const middle = in.row(y);
  for (int x = 0; x < in.width; ++x)
    sums.range_m[x] = 5 * static_cast<float>(precision.sigma_m(middle[x]));
  std::fill(sums.depth.begin(), sums.depth.end(), 0.0f);
  std::fill(sums.weight.begin(), sums.weight.end(), 0.0f);
  for (int v = std::max(0, y - kRadius); v <= std::min(in.height - 1, y + kRadius); ++v)
    for (int du = -kRadius; du <= kRadius; ++du) {
      const int dv = v - y, near = (kRadius + 1) * (kRadius + 1) - (du * du + dv * dv) / 2;
      add_row(middle, in.row(v), in.width, du, static_cast<float>(near), sums);
    }
  for (int x = 0; x < in.width; ++x) out[x] = middle[x] > 0 ? sums.depth[x] / sums.weight[x] : 0.0f;
}

}  // namespace

ImageDepth smooth_depth(const ImageDepth& depth, const Precision& precision) {
  ImageDepth out(depth.width, depth.height);
  parallel_for(depth.height, 16, [&](std::size_t begin, std::size_t end) {
    Sums sums(depth.width);
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      smooth_row(depth, y, precision, sums, out.row(y));
  });
  return out;
}

}  // namespace mr::fusion
