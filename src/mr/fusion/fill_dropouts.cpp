#include "mr/fusion/fill_dropouts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr int kRounds = 2;
constexpr float kSlope = 0.015f;  // of the depth: what a slanted surface rises in two pixels

/// The mean of the opposite neighbours that agree best; 0 when none do.
float between(const ImageDepth& depth, int x, int y, const Precision& precision) {
  float best = 0, least = 0;
  for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 1}, {1, 1}, {1, -1}}) {
    const float a = *depth.at(x - dx, y - dy), b = *depth.at(x + dx, y + dy);
    if (a <= 0 || b <= 0) continue;
    const float mean = 0.5f * (a + b), apart = std::abs(a - b);
    if (apart > 5 * static_cast<float>(precision.sigma_m(mean)) + kSlope * mean) continue;
    if (best == 0 || apart < least) best = mean, least = apart;
  }
  return best;
}

}  // namespace

ImageDepth fill_dropouts(const ImageDepth& depth, const Precision& precision) {
  ImageDepth from, to = depth;
  for (int round = 0; round < kRounds; ++round) {
    from = to;
    parallel_for(depth.height, 16, [&](std::size_t begin, std::size_t end) {
      const int last = std::min(static_cast<int>(end), depth.height - 1);
      for (int y = std::max(static_cast<int>(begin), 1); y < last; ++y)
        for (int x = 1; x < depth.width - 1; ++x)
          if (*from.at(x, y) <= 0) *to.at(x, y) = between(from, x, y, precision);
    });
  }
  return to;
}

}  // namespace mr::fusion
