#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/vec.h"

namespace mr::merge {

/// Points sorted into the cells of a grid, to find those in a ball.
class PointGrid {
 public:
  /// `cell_m`: about half of the usual radius. Points must be finite.
  PointGrid(std::span<const Vec3f> points, double cell_m);

  /// Calls visit(place) for every point nearer than `radius_m`, in an order that depends on the
  /// points only.
  template <typename Visit>
  void within(Vec3f middle, float radius_m, Visit&& visit) const {
    if (points_.empty()) return;
    const Vec3i low = cell(middle - Vec3f{radius_m, radius_m, radius_m}),
                high = cell(middle + Vec3f{radius_m, radius_m, radius_m});
    const float limit = radius_m * radius_m;
    for (int z = low.z; z <= high.z; ++z)
      for (int y = low.y; y <= high.y; ++y) {
        const std::size_t row = (static_cast<std::size_t>(z) * size_.y + y) * size_.x;
        for (std::uint32_t i = first_[row + low.x]; i < first_[row + high.x + 1]; ++i) {
          const Vec3f d = points_[i] - middle;
          if (dot(d, d) < limit) visit(place_[i]);
        }
      }
  }

 private:
  Vec3i cell(Vec3f p) const;

  Vec3f low_;
  float per_cell_ = 1;
  Vec3i size_{1, 1, 1};
  std::vector<std::uint32_t> first_;  // [cells + 1], x fastest
  std::vector<Vec3f> points_;         // by cell
  std::vector<std::uint32_t> place_;  // of points_ in the input
};

}  // namespace mr::merge
