#include "mr/merge/holes/guessed_surface.h"

#include <algorithm>
#include <cmath>

#include "mr/merge/cell.h"

namespace mr::merge {
namespace {

constexpr float kPerCell = 10;    // cells of 10 cm
constexpr float kMostCells = 64;  // around a triangle; who has more is compared with every point

bool contains(const GuessedTriangle& t, Vec3f p, float tolerance_m) {
  const Vec3f normal = normalized(cross(t[1] - t[0], t[2] - t[0]));
  if (std::abs(dot(p - t[0], normal)) > tolerance_m) return false;
  for (int i = 0; i < 3; ++i)
    if (dot(cross(t[(i + 1) % 3] - t[i], p - t[i]), normal) <= 0) return false;
  return true;
}

}  // namespace

GuessedSurface::GuessedSurface(std::vector<GuessedTriangle> triangles, double tolerance_m)
    : tolerance_m_(static_cast<float>(tolerance_m)), triangles_(std::move(triangles)) {
  for (std::uint32_t i = 0; i < triangles_.size(); ++i) {
    Box3f box;
    for (const Vec3f p : triangles_[i]) box.add(p);
    const Vec3f around{tolerance_m_, tolerance_m_, tolerance_m_};
    const CellBox cells{cell_at((box.low - around) * kPerCell),
                        cell_at((box.high + around) * kPerCell)};
    if (cells.count() > kMostCells)
      large_.push_back(i);
    else
      cells.for_each([&](std::uint64_t key) { by_cell_.emplace_back(key, i); });
  }
  std::ranges::sort(by_cell_);
}

bool GuessedSurface::has(Vec3f p) const {
  const std::uint64_t cell = cell_key(cell_at(p * kPerCell));
  auto near = std::lower_bound(by_cell_.begin(), by_cell_.end(), std::pair(cell, 0u));
  for (; near != by_cell_.end() && near->first == cell; ++near)
    if (contains(triangles_[near->second], p, tolerance_m_)) return true;
  return std::ranges::any_of(
      large_, [&](std::uint32_t i) { return contains(triangles_[i], p, tolerance_m_); });
}

std::vector<std::uint8_t> GuessedSurface::marks(const Mesh& mesh) const {
  std::vector<std::uint8_t> out;
  if (empty()) return out;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) out.push_back(has(mesh.centroid(t)));
  if (std::ranges::count(out, 0) == std::ssize(out)) out.clear();
  return out;
}

}  // namespace mr::merge
