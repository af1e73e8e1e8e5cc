#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/simplify/collapser.h"

namespace mr::simplify {

/// Goes through the vertices of a mesh on all threads, in an order that depends on the mesh alone.
/// Work on a vertex may change its neighbours, so only vertices that share none are worked on at
/// once: first, range by range, those whose neighbours all lie in the same range; then, cell by
/// cell of a coarse grid in space, those of the others whose neighbours lie in the same cell; at
/// last the few that are left. So vertices between two ranges are treated as all others, in the
/// same round.
class Sweep {
 public:
  /// Lays the grid over the mesh.
  void start(const ShrinkingMesh& mesh);

  /// Calls work(collapser, v) for each vertex with wanted(v); returns the sum of what that returns.
  /// `wanted` is asked once, before v's turn; it may be gone by then only if it lies between
  /// ranges, and then is left out.
  template <typename Wanted, typename Work>
  std::size_t run(ShrinkingMesh& mesh, const Wanted& wanted, const Work& work);

 private:
  static constexpr std::uint32_t kCells = 16;  // along each axis, at most

  std::uint32_t cell_of(Vec3f p) const;
  bool is_inside(const ShrinkingMesh& mesh, std::uint32_t v, std::uint32_t cell) const;
  std::vector<std::uint32_t> sort_by_cell(const ShrinkingMesh& mesh);

  Vec3f origin_;
  float cells_per_m_ = 0;
  std::vector<std::vector<std::uint32_t>> between_;  // by range: vertices that span it
  std::vector<std::uint32_t> by_cell_;               // the same, sorted
  std::vector<std::vector<std::uint32_t>> last_;     // by cell: what spans that, too
  std::vector<std::size_t> sums_;
};

template <typename Wanted, typename Work>
std::size_t Sweep::run(ShrinkingMesh& mesh, const Wanted& wanted, const Work& work) {
  between_.resize(mesh.ranges());
  sums_.assign(mesh.ranges(), 0);
  parallel_for(mesh.ranges(), 1, [&](std::size_t begin, std::size_t end) {
    Collapser collapser(mesh);
    for (auto range = static_cast<std::uint32_t>(begin); range < end; ++range) {
      between_[range].clear();
      std::size_t sum = 0;
      for (std::uint32_t v = mesh.begin(range); v < mesh.end(range); ++v) {
        if (!wanted(v)) continue;
        if (mesh.spans[v])
          between_[range].push_back(v);
        else
          sum += work(collapser, v);
      }
      sums_[range] = sum;
    }
  });
  std::size_t total = std::accumulate(sums_.begin(), sums_.end(), std::size_t{0});

  // From here on rings may come to reach from range to range.
  const auto work_between = [&](Collapser& collapser, std::uint32_t v) {
    const Rings::Line ring = mesh.rings.ring(v);
    const std::uint32_t size = mesh.rings.size(v);
    const std::size_t done = work(collapser, v);
    for (std::uint32_t i = 0; done > 0 && i < size; ++i)
      if (!mesh.rings.is_complex(ring[i])) mesh.spans[ring[i]] |= mesh.reaches_out(ring[i]);
    return done;
  };
  const std::vector<std::uint32_t> first = sort_by_cell(mesh);
  const std::size_t cells = first.size() - 1;
  last_.resize(cells), sums_.assign(cells, 0);
  parallel_for(cells, 1, [&](std::size_t begin, std::size_t end) {
    Collapser collapser(mesh);
    for (std::size_t c = begin; c < end; ++c) {
      last_[c].clear();
      const std::uint32_t cell = cell_of(mesh.places[by_cell_[first[c]]].at);
      for (std::uint32_t i = first[c]; i < first[c + 1]; ++i) {
        const std::uint32_t v = by_cell_[i];
        if (!mesh.rings.alive(v)) continue;
        if (is_inside(mesh, v, cell))
          sums_[c] += work_between(collapser, v);
        else
          last_[c].push_back(v);
      }
    }
  });
  total = std::accumulate(sums_.begin(), sums_.end(), total);

  Collapser collapser(mesh);
  for (std::size_t c = 0; c < cells; ++c)
    for (const std::uint32_t v : last_[c])
      if (mesh.rings.alive(v)) total += work_between(collapser, v);
  return total;
}

}  // namespace mr::simplify
