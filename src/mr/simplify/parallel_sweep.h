#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/simplify/edge_collapser.h"

namespace mr::simplify {

/// Visits the vertices of a mesh on all threads, deterministically. As work on a vertex may change
/// its neighbours, no two threads may process vertices that share one. So there are three phases:
/// vertices whose neighbours all lie in their range, one range per task; of the rest those whose
/// neighbours all lie in their cell of a coarse grid, one cell per task; the few others serially.
/// Thus vertices between two ranges are treated like all others, in the same round.
class ParallelSweep {
 public:
  /// Prepares the grid for a mesh.
  void start(const WorkingMesh& mesh);

  /// Calls work(collapser, v) for each vertex with wanted(v), which is evaluated before the first
  /// call of work; returns the sum of the results. Stops at about `budget`, which is shared among
  /// ranges and cells in proportion to their numbers of vertices.
  template <typename Wanted, typename Work>
  std::size_t run(WorkingMesh& mesh, std::size_t budget, const Wanted& wanted, const Work& work);

 private:
  static constexpr std::uint32_t kCells = 16;  // along each axis, at most

  std::uint32_t cell_of(Vec3f p) const;
  bool is_inside(const WorkingMesh& mesh, std::uint32_t v, std::uint32_t cell) const;
  std::vector<std::uint32_t> sort_by_cell(const WorkingMesh& mesh);

  Vec3f origin_;
  float cells_per_m_ = 0;
  std::vector<std::vector<std::uint32_t>> within_;  // by range: vertices with neighbours there only
  std::vector<std::vector<std::uint32_t>> between_;  // by range: vertices that span it
  std::vector<std::uint32_t> by_cell_;               // the same, sorted
  std::vector<std::vector<std::uint32_t>> last_;     // by cell: what spans that, too
  std::vector<std::size_t> sums_;
};

/// A part's share of a budget.
inline std::size_t share_of(std::size_t budget, std::size_t part, std::size_t whole) {
  if (whole == 0) return 0;
  const double share = static_cast<double>(part) / static_cast<double>(whole);
  return static_cast<std::size_t>(std::ceil(static_cast<double>(budget) * share));
}

template <typename Wanted, typename Work>
std::size_t ParallelSweep::run(WorkingMesh& mesh, std::size_t budget, const Wanted& wanted,
                               const Work& work) {
  within_.resize(mesh.ranges()), between_.resize(mesh.ranges());
  mesh.for_each_range([&](std::uint32_t range) {
    within_[range].clear(), between_[range].clear();
    for (std::uint32_t v = mesh.begin(range); v < mesh.end(range); ++v)
      if (wanted(v)) (mesh.spans[v] ? between_ : within_)[range].push_back(v);
  });
  std::size_t all = 0;
  for (std::uint32_t range = 0; range < mesh.ranges(); ++range)
    all += within_[range].size() + between_[range].size();
  sums_.assign(mesh.ranges(), 0);
  mesh.for_each_range([&](std::uint32_t range) {
    EdgeCollapser collapser(mesh);
    const std::size_t most = share_of(budget, within_[range].size(), all);
    std::size_t sum = 0;
    for (const std::uint32_t v : within_[range]) {
      if (sum >= most) break;
      sum += work(collapser, v);
    }
    sums_[range] = sum;
  });
  std::size_t total = std::accumulate(sums_.begin(), sums_.end(), std::size_t{0});

  // From here on rings may come to reach from range to range.
  const auto work_between = [&](EdgeCollapser& collapser, std::uint32_t v) {
    const VertexRings::Line ring = mesh.rings.ring(v);
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
    EdgeCollapser collapser(mesh);
    for (std::size_t c = begin; c < end; ++c) {
      last_[c].clear();
      const std::uint32_t cell = cell_of(mesh.places[by_cell_[first[c]]].at);
      const std::size_t most = share_of(budget, first[c + 1] - first[c], all);
      for (std::uint32_t i = first[c]; i < first[c + 1]; ++i) {
        const std::uint32_t v = by_cell_[i];
        if (sums_[c] >= most) break;
        if (!mesh.rings.alive(v)) continue;
        if (is_inside(mesh, v, cell))
          sums_[c] += work_between(collapser, v);
        else
          last_[c].push_back(v);
      }
    }
  });
  total = std::accumulate(sums_.begin(), sums_.end(), total);

  EdgeCollapser collapser(mesh);
  for (std::size_t c = 0; c < cells; ++c)
    for (const std::uint32_t v : last_[c])
      if (mesh.rings.alive(v) && total < budget) total += work_between(collapser, v);
  return total;
}

}  // namespace mr::simplify
