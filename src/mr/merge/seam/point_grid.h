#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/vec.h"

namespace mr::merge {

/// A uniform grid for fixed-radius neighbour search: cells in y and z, points sorted along x in
/// each.
class PointGrid {
 public:
  /// `cell_m`: size of a cell, best the usual radius or half of it; enlarged in a large, sparsely
  /// filled space. Points must be finite.
  PointGrid(std::span<const Vec3f> points, double cell_m);

  /// Calls visit(index) for every point within `radius_m`, in an order that depends on the points
  /// only.
  template <typename Visit>
  void within(Vec3f middle, float radius_m, Visit&& visit) const {
    if (points_.empty()) return;
    const float reach = radius_m + slack_m_, limit = radius_m * radius_m;
    const int low_y = cell(middle.y - reach, low_.y, rows_y_),
              high_y = cell(middle.y + reach, low_.y, rows_y_),
              low_z = cell(middle.z - reach, low_.z, rows_z_),
              high_z = cell(middle.z + reach, low_.z, rows_z_);
    for (int z = low_z; z <= high_z; ++z)
      for (int y = low_y; y <= high_y; ++y) {
        const std::uint32_t row = row_number(y, z), end = first_[row + 1];
        for (std::uint32_t i = first_not_left(row, middle.x, radius_m); i < end; ++i) {
          const Vec3f d = points_[i].at - middle;
          if (d.x >= radius_m) break;
          if (dot(d, d) < limit) visit(points_[i].place);
        }
      }
  }

  /// The neighbourhood of a point.
  struct Match {
    static constexpr std::uint32_t kNone = 0xFFFFFFFFu;

    std::uint32_t neighbours = 0;   ///< other points nearer than the radius
    std::uint32_t nearest = kNone;  ///< of those with another tag; the first of several
    float distance_m = 0;           ///< to it

    friend bool operator==(const Match&, const Match&) = default;
  };

  /// The neighbourhood of every point, in the points' order; much faster than calling within() for
  /// each. `tags`: [points]. Parallel; deterministic.
  std::vector<Match> match(std::span<const std::uint32_t> tags, float radius_m) const;

 private:
  class Matcher;
  struct Point {
    Vec3f at;
    std::uint32_t place = 0;  // in the input
  };

  int cell(float at, float low, int count) const {
    const float place = (at - low) * per_cell_;
    return place > 0 ? std::min(static_cast<int>(std::min(place, 1e9f)), count - 1) : 0;
  }
  std::uint32_t row_number(int y, int z) const {
    return static_cast<std::uint32_t>(z) * rows_y_ + y;
  }
  std::uint32_t row_of(float y, float z) const {
    return row_number(cell(y, low_.y, rows_y_), cell(z, low_.z, rows_z_));
  }
  /// The first point of a row that is not too far towards lower x.
  std::uint32_t first_not_left(std::uint32_t row, float x, float radius_m) const {
    const auto from = points_.begin() + first_[row], to = points_.begin() + first_[row + 1];
    const auto is_left = [&](const Point& point) { return point.at.x - x <= -radius_m; };
    return static_cast<std::uint32_t>(std::partition_point(from, to, is_left) - points_.begin());
  }

  void set_size(const Box3f& box, std::size_t points, double cell_m);
  void sort_into_rows(std::span<const Vec3f> points);

  Vec3f low_;
  float per_cell_ = 1, slack_m_ = 0;  // slack: what rounding may take from a distance
  int rows_y_ = 1, rows_z_ = 1;
  std::vector<std::uint32_t> first_;  // [rows + 1], y fastest
  std::vector<Point> points_;         // by row, then by x
};

}  // namespace mr::merge
