#include "mr/merge/point_grid.h"

#include <numeric>

namespace mr::merge {

PointGrid::PointGrid(std::span<const Vec3f> points, double cell_m) {
  constexpr int kMostCells = 64;  // along an axis: the directory stays small in large scenes
  Box3f box;
  for (const Vec3f p : points) box.add(p);
  if (box.empty()) return;
  const Vec3f size = box.high - box.low;
  const float cell_size =
      std::max(static_cast<float>(cell_m), std::max({size.x, size.y, size.z}) / kMostCells);
  low_ = box.low, per_cell_ = 1 / cell_size;
  size_ = {1 << 20, 1 << 20, 1 << 20};
  size_ = cell(box.high) + Vec3i{1, 1, 1};

  const auto number = [&](Vec3f p) {
    const Vec3i c = cell(p);
    return (static_cast<std::size_t>(c.z) * size_.y + c.y) * size_.x + c.x;
  };
  first_.assign(static_cast<std::size_t>(size_.x) * size_.y * size_.z + 1, 0);
  for (const Vec3f p : points) ++first_[number(p) + 1];
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  points_.resize(points.size()), place_.resize(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const std::uint32_t at = next[number(points[i])]++;
    points_[at] = points[i], place_[at] = i;
  }
}

Vec3i PointGrid::cell(Vec3f p) const {
  const auto along = [&](float x, float low, int count) {
    const float place = (x - low) * per_cell_;
    return place > 0 ? std::min(static_cast<int>(std::min(place, 1e6f)), count - 1) : 0;
  };
  return {along(p.x, low_.x, size_.x), along(p.y, low_.y, size_.y), along(p.z, low_.z, size_.z)};
}

}  // namespace mr::merge
