#include "mr/synth/floor_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <utility>

namespace mr::synth {
namespace {

constexpr double kPathCell_m = 0.1;

/// Shortest ways on a grid (Dijkstra); to come near to something costs extra.
class PathGrid {
 public:
  explicit PathGrid(const FloorPlan& plan)
      : low_{-plan.half_width_m(), -plan.half_depth_m()},
        columns_(static_cast<int>(2 * plan.half_width_m() / kPathCell_m) + 1),
        rows_(static_cast<int>(2 * plan.half_depth_m() / kPathCell_m) + 1) {
    constexpr double kFree_m = 0.4, kPenalty = 25;
    for (int i = 0; i < columns_ * rows_; ++i) {
      const double near = std::max(0.0, 1 - plan.walking_clearance_m(place(i)) / kFree_m);
      price_.push_back(1 + kPenalty * near * near);
    }
  }

  std::vector<Vec2d> way(Vec2d from, Vec2d to) const {
    const int start = cell(from), goal = cell(to);
    std::vector<double> cost(price_.size(), 1e18);
    std::vector<int> before(price_.size(), -1);
    std::priority_queue<std::pair<double, int>, std::vector<std::pair<double, int>>, std::greater<>>
        open;
    open.push({cost[start] = 0, start});
    while (!open.empty()) {
      const auto [paid, here] = open.top();
      open.pop();
      if (here == goal) break;
      if (paid > cost[here]) continue;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          const int x = here % columns_ + dx, y = here / columns_ + dy;
          if (x < 0 || y < 0 || x >= columns_ || y >= rows_) continue;
          const int there = y * columns_ + x;
          const double sum = paid + std::hypot(dx, dy) * price_[there];
          if (sum >= cost[there]) continue;
          before[there] = here;
          open.push({cost[there] = sum, there});
        }
    }
    std::vector<Vec2d> out{to};
    for (int i = before[goal]; i >= 0 && i != start; i = before[i]) out.push_back(place(i));
    out.push_back(from);
    std::reverse(out.begin(), out.end());
    return out;
  }

 private:
  Vec2d place(int i) const {
    return low_ + Vec2d{kPathCell_m * (i % columns_), kPathCell_m * (i / columns_)};
  }
  int cell(Vec2d p) const {
    const int x = static_cast<int>(std::lround((p.x - low_.x) / kPathCell_m)),
              y = static_cast<int>(std::lround((p.y - low_.y) / kPathCell_m));
    return std::clamp(y, 0, rows_ - 1) * columns_ + std::clamp(x, 0, columns_ - 1);
  }

  const Vec2d low_;
  const int columns_, rows_;
  std::vector<double> price_;  // [rows * columns]
};

}  // namespace

FloorPath::FloorPath(const FloorPlan& plan, Vec2d first, Vec2d second, Vec2d last)
    : points_{first} {
  const std::vector<Vec2d> way = PathGrid(plan).way(second, last);
  points_.insert(points_.end(), way.begin(), way.end());
  measure();
}

void FloorPath::measure() {
  along_ = {0};
  for (std::size_t i = 1; i < points_.size(); ++i) {
    const Vec2d step = points_[i] - points_[i - 1];
    along_.push_back(along_.back() + std::hypot(step.x, step.y) + 1e-9);
  }
}

FloorPath FloorPath::reversed() const {
  FloorPath out;
  out.points_.assign(points_.rbegin(), points_.rend());
  out.measure();
  return out;
}

/// Straight on before the first and behind the last point.
Vec2d FloorPath::point(double along_m) const {
  const auto next = std::upper_bound(along_.begin() + 1, along_.end() - 1, along_m);
  const auto i = static_cast<std::size_t>(next - along_.begin()) - 1;
  const double part = (along_m - along_[i]) / (along_[i + 1] - along_[i]);
  return points_[i] * (1 - part) + points_[i + 1] * part;
}

FloorPose FloorPath::at(double part) const {
  constexpr double kRound_m = 0.35, kSamples = 7;  // to either side
  const double along = std::clamp(part, 0.0, 1.0) * length_m();
  Vec2d sum;
  for (double i = -kSamples; i <= kSamples; ++i) sum = sum + point(along + kRound_m * i / kSamples);
  const Vec2d way = point(along + kRound_m) - point(along - kRound_m);
  return {sum * (1 / (2 * kSamples + 1)), std::atan2(way.y, way.x)};
}

}  // namespace mr::synth
