#include "mr/fusion/smooth_depth.h"

#include <algorithm>

#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr int kRadius = 3;

float smoothed(const ImageDepth& depth, int x, int y, float range_m) {
  const float middle = *depth.at(x, y);
  float sum = 0, weights = 0;
  for (int v = std::max(0, y - kRadius); v <= std::min(depth.height - 1, y + kRadius); ++v)
    for (int u = std::max(0, x - kRadius); u <= std::min(depth.width - 1, x + kRadius); ++u) {
      const float d = *depth.at(u, v);
      const float off = (d - middle) / range_m;
      if (d <= 0 || off * off >= 1) continue;
      const float near = static_cast<float>((kRadius + 1) * (kRadius + 1) -
                                            ((u - x) * (u - x) + (v - y) * (v - y)) / 2);
      const float alike = (1 - off * off) * (1 - off * off);
      sum += near * alike * d, weights += near * alike;
    }
  return sum / weights;
}

}  // namespace

ImageDepth smooth_depth(const ImageDepth& depth, const Precision& precision) {
  ImageDepth out(depth.width, depth.height);
  parallel_for(depth.height, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < depth.width; ++x) {
        const float d = *depth.at(x, y);
        if (d > 0)
          *out.at(x, y) = smoothed(depth, x, y, 5 * static_cast<float>(precision.sigma_m(d)));
      }
  });
  return out;
}

}  // namespace mr::fusion
