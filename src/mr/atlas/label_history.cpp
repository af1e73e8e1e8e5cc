#include "mr/atlas/label_history.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace mr::atlas {
namespace {

Vec3i cell_of(Vec3f in_cells) {
  return {static_cast<std::int32_t>(std::floor(in_cells.x)),
          static_cast<std::int32_t>(std::floor(in_cells.y)),
          static_cast<std::int32_t>(std::floor(in_cells.z))};
}

std::uint64_t key_of(Vec3i cell) {
  constexpr std::uint64_t kMask = (1u << 21) - 1;
  const auto bits = [&](std::int32_t v) { return static_cast<std::uint64_t>(v) & kMask; };
  return bits(cell.x) << 42 | bits(cell.y) << 21 | bits(cell.z);
}

}  // namespace

LabelHistory::LabelHistory(const Mesh& mesh) : cells_(mesh.triangles.size() / 2) {
  // A mesh's runs are sorted by view: a cell's area of one view is whole when the next one begins.
  std::vector<float> most, now;
  std::vector<ViewId> current;
  for (const ViewRun& run : mesh.views) {
    if (run.id == kNoView) continue;
    for (std::uint32_t t = run.first; t < run.first + run.count; ++t) {
      const std::uint32_t cell =
          cells_.get_or_add(key_of(cell_of(mesh.centroid(t) * (1 / kCell_m))),
                            static_cast<std::uint32_t>(views_.size()));
      if (cell == views_.size())
        views_.push_back(run.id), current.push_back(run.id), most.push_back(0), now.push_back(0);
      if (current[cell] != run.id) current[cell] = run.id, now[cell] = 0;
      now[cell] += length(mesh.area_normal(t));
      if (now[cell] > most[cell]) most[cell] = now[cell], views_[cell] = run.id;
    }
  }
}

ViewId LabelHistory::at(Vec3f p) const {
  if (views_.empty()) return kNoView;
  const Vec3f in_cells = p * (1 / kCell_m);
  const Vec3i cell = cell_of(in_cells);
  const auto find = [&](Vec3i c) { return cells_.find(key_of(c)); };
  if (const std::uint32_t* const here = find(cell)) return views_[*here];
  struct Beside {
    float distance;
    Vec3i cell;
  };
  std::array<Beside, 6> beside;
  for (int axis = 0; axis < 3; ++axis) {
    const float in = in_cells[axis] - static_cast<float>(cell[axis]);
    Vec3i low = cell, high = cell;
    --low[axis], ++high[axis];
    beside[2 * axis] = {in, low}, beside[2 * axis + 1] = {1 - in, high};
  }
  std::ranges::stable_sort(beside, {}, &Beside::distance);
  for (const Beside& b : beside)
    if (const std::uint32_t* const found = find(b.cell)) return views_[*found];
  return kNoView;
}

}  // namespace mr::atlas
