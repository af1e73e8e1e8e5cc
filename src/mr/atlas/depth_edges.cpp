#include "mr/atlas/depth_edges.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace mr::atlas {
namespace {

constexpr float kEdge_m = 0.05f;  // a jump of depth that is an edge
constexpr float kSlope = 3;       // depth per width; a steeper slope (72 degrees) is an edge

}  // namespace

DepthEdges::DepthEdges(const ImageDepth& depth, float pixel)
    : columns_((depth.width + kCell_px - 1) / kCell_px),
      rows_((depth.height + kCell_px - 1) / kCell_px),
      distance_px_(static_cast<std::size_t>(columns_) * rows_, kFar_px) {
  const float per_depth = kSlope * pixel * (kCell_px + 1);
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      float low = std::numeric_limits<float>::max(), high = 0;
      bool any_empty = false;
      // One pixel more than the cell: an edge between two cells belongs to the first.
      const int x_end = std::min((column + 1) * kCell_px + 1, depth.width),
                y_end = std::min((row + 1) * kCell_px + 1, depth.height);
      for (int y = row * kCell_px; y < y_end; ++y)
        for (int x = column * kCell_px; x < x_end; ++x) {
          const float d = *depth.at(x, y);
          any_empty |= d == 0;
          low = std::min(low, d > 0 ? d : low), high = std::max(high, d);
        }
      if (high > 0 && (any_empty || high - low > kEdge_m + per_depth * low))
        distance_px_[static_cast<std::size_t>(row) * columns_ + column] = 0;
    }
  constexpr float kSide = kCell_px, kAcross = kCell_px * std::numbers::sqrt2_v<float>;
  const auto pass = [&](int row, int column, int step) {
    float& d = distance_px_[static_cast<std::size_t>(row) * columns_ + column];
    const auto from = [&](int dx, int dy, float length) {
      const int x = column + dx, y = row + dy;
      if (x >= 0 && y >= 0 && x < columns_ && y < rows_)
        d = std::min(d, distance_px_[static_cast<std::size_t>(y) * columns_ + x] + length);
    };
    from(-step, 0, kSide), from(0, -step, kSide);
    from(-step, -step, kAcross), from(step, -step, kAcross);
  };
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) pass(row, column, 1);
  for (int row = rows_ - 1; row >= 0; --row)
    for (int column = columns_ - 1; column >= 0; --column) pass(row, column, -1);
}

float DepthEdges::distance_px(float x, float y) const {
  const auto place = [](float at, int count) {
    return std::clamp((at + 0.5f) / kCell_px - 0.5f, 0.0f, static_cast<float>(count - 1));
  };
  const float u = place(x, columns_), v = place(y, rows_);
  const int x0 = static_cast<int>(u), y0 = static_cast<int>(v);
  const int x1 = std::min(x0 + 1, columns_ - 1), y1 = std::min(y0 + 1, rows_ - 1);
  const float fx = u - static_cast<float>(x0), fy = v - static_cast<float>(y0);
  const auto at = [&](int column, int row) {
    return distance_px_[static_cast<std::size_t>(row) * columns_ + column];
  };
  return (at(x0, y0) * (1 - fx) + at(x1, y0) * fx) * (1 - fy) +
         (at(x0, y1) * (1 - fx) + at(x1, y1) * fx) * fy;
}

}  // namespace mr::atlas
