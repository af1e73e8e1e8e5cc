#include "mr/simplify/parallel_sweep.h"

#include <algorithm>
#include <utility>

namespace mr::simplify {

void ParallelSweep::start(const WorkingMesh& mesh) {
  struct Box {
    Vec3f low{kNever, kNever, kNever}, high{-kNever, -kNever, -kNever};
    void add(Vec3f p) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
  };
  std::vector<Box> boxes(mesh.ranges());
  parallel_for(boxes.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (auto range = static_cast<std::uint32_t>(begin); range < end; ++range)
      for (std::uint32_t v = mesh.begin(range); v < mesh.end(range); ++v)
        if (mesh.rings.alive(v)) boxes[range].add(mesh.places[v].at);
  });
  Box all;
  for (const Box& box : boxes) all.add(box.low), all.add(box.high);
  const Vec3f size = all.high - all.low;
  const float edge = std::max({size.x, size.y, size.z, 1e-6f}) / (kCells / 2);
  // Half a cell off, so that symmetric scenes are not cut in the middle.
  origin_ = all.low - Vec3f{edge, edge, edge} / 2.0f;
  cells_per_m_ = 1 / edge;
}

std::uint32_t ParallelSweep::cell_of(Vec3f p) const {
  const auto along = [&](float at, float from) {
    const float cell = (at - from) * cells_per_m_;
    return static_cast<std::uint32_t>(std::clamp(cell, 0.0f, kCells - 1.0f));
  };
  return (along(p.z, origin_.z) * kCells + along(p.y, origin_.y)) * kCells + along(p.x, origin_.x);
}

bool ParallelSweep::is_inside(const WorkingMesh& mesh, std::uint32_t v, std::uint32_t cell) const {
  for (std::uint32_t i = 0; i < mesh.rings.size(v); ++i)
    if (cell_of(mesh.places[mesh.rings.ring(v)[i]].at) != cell) return false;
  return true;
}

/// Sorts the vertices between ranges by their cells. Returns where each cell that has any begins in
/// by_cell_, and its end.
std::vector<std::uint32_t> ParallelSweep::sort_by_cell(const WorkingMesh& mesh) {
  std::vector<std::uint32_t> at(kCells * kCells * kCells + 1, 0);
  std::uint32_t count = 0;
  for (const auto& vertices : between_)
    for (const std::uint32_t v : vertices) ++at[cell_of(mesh.places[v].at)], ++count;
  std::vector<std::uint32_t> first;
  std::uint32_t sum = 0;
  for (std::uint32_t& n : at) {
    if (n > 0) first.push_back(sum);
    sum += std::exchange(n, sum);
  }
  first.push_back(sum);
  by_cell_.resize(count);
  for (const auto& vertices : between_)
    for (const std::uint32_t v : vertices) by_cell_[at[cell_of(mesh.places[v].at)]++] = v;
  return first;
}

}  // namespace mr::simplify
