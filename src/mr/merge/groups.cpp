#include "mr/merge/groups.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/boxes.h"
#include "mr/kit/disjoint_sets.h"
#include "mr/kit/pair_map.h"
#include "mr/merge/cell.h"
#include "mr/merge/subdivide.h"

namespace mr::merge {
namespace {

constexpr std::size_t kFew = 6;       // up to so many meshes are one group without a search
constexpr double kCell_reaches = 3;   // so that a point within reach of a piece of a triangle
constexpr float kPiece_cells = 0.5f;  // lies at most in the cell next to the piece's centre
// Of an edge; a mesh with a larger triangle is joined with all meshes near it.
constexpr float kMostPieces = 64;
constexpr std::size_t kEvery = 4;  // in the first pass, every kEvery-th vertex is tested

using Cells = std::vector<Vec3i>;

/// A list of cells without duplicates.
class UniqueCells {
 public:
  void add(Vec3i cell) {
    if (cell == last_) return;
    last_ = cell;
    const auto fresh = static_cast<std::uint32_t>(cells_.size());
    if (known_.get_or_add(cell_key(cell), fresh) == fresh) cells_.push_back(cell);
  }
  Cells take() && { return std::move(cells_); }

 private:
  kit::PairMap known_{256};
  Vec3i last_{1 << 30, 0, 0};
  Cells cells_;
};

class Grouping {
 public:
  Grouping(std::span<const Mesh* const> meshes, double reach_m)
      : meshes_(meshes),
        per_cell_(static_cast<float>(1 / (kCell_reaches * reach_m))),
        reach_m_(static_cast<float>(reach_m)),
        sets_(meshes.size()) {}

  /// Joins meshes that come near each other. Most of these share a cell that contains vertices of
  /// both; the others are tested piece by piece of their triangles, only near other meshes.
  void run() {
    join_sharing(cells_of_all([&](std::uint32_t m) { return cells_of_vertices(*meshes_[m]); }));
    find_nearby();
    const auto close = cells_of_all([&](std::uint32_t m) { return cells_near_others(m); });
    for (std::uint32_t m = 0; m < is_huge_.size(); ++m)
      if (is_huge_[m])
        for (const NearbyMesh& near : nearby_[m]) join(m, near.mesh);
    join_sharing(close);
    join_beside(close);
  }

  std::uint32_t of(std::uint32_t mesh) { return sets_.of(mesh); }
  void join(std::uint32_t a, std::uint32_t b) { sets_.join(a, b); }

 private:
  /// A mesh of another set that may be within reach, and where it is.
  struct NearbyMesh {
    std::uint32_t mesh;
    Box3f box;
  };

  template <typename Work>
  std::vector<Cells> cells_of_all(Work&& work) const {
    std::vector<Cells> out(meshes_.size());
    parallel_for(out.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t m = begin; m < end; ++m) out[m] = work(static_cast<std::uint32_t>(m));
    });
    return out;
  }

  Cells cells_of_vertices(const Mesh& mesh) const {
    UniqueCells out;
    for (std::size_t v = 0; v < mesh.positions.size(); v += kEvery)
      out.add(cell_at(mesh.positions[v] * per_cell_));
    return std::move(out).take();
  }

  /// Where a mesh of another set may be within reach.
  void find_nearby() {
    std::vector<Box3f> boxes(meshes_.size());
    parallel_for(boxes.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t m = begin; m < end; ++m)
        for (const Vec3f p : meshes_[m]->positions) boxes[m].add(p);
    });
    nearby_.resize(meshes_.size()), is_huge_.resize(meshes_.size());
    for (std::uint32_t m = 0; m < meshes_.size(); ++m)
      for (std::uint32_t other = 0; other < meshes_.size(); ++other)
        if (of(m) != of(other) && kit::meet(boxes[m], boxes[other], reach_m_))
          nearby_[m].push_back({other, boxes[other]});
  }

  /// The cells that the middles of a mesh's triangles lie in, or of their pieces, as far as nearby
  /// meshes may be near.
  Cells cells_near_others(std::uint32_t m) {
    const Mesh& mesh = *meshes_[m];
    if (nearby_[m].empty()) return {};
    UniqueCells out;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      Box3f box;
      for (int i = 0; i < 3; ++i) box.add(mesh.corner(t, i));
      if (std::ranges::none_of(
              nearby_[m], [&](const NearbyMesh& r) { return kit::meet(r.box, box, reach_m_); }))
        continue;
      const Vec3f a = mesh.corner(t, 0) * per_cell_, ab = mesh.corner(t, 1) * per_cell_ - a,
                  ac = mesh.corner(t, 2) * per_cell_ - a;
      const float pieces = std::max({length(ab), length(ac), length(ac - ab)}) / kPiece_cells;
      is_huge_[m] |= !(pieces <= kMostPieces);
      if (is_huge_[m]) return {};
      for_each_subtriangle(std::max(static_cast<int>(std::ceil(pieces)), 1),
                           [&](float b, float c) { out.add(cell_at(a + ab * b + ac * c)); });
    }
    return std::move(out).take();
  }

  void join_sharing(const std::vector<Cells>& cells) {
    for (std::uint32_t m = 0; m < cells.size(); ++m)
      for (const Vec3i cell : cells[m]) join(m, first_.get_or_add(cell_key(cell), m));
  }
  void join_beside(const std::vector<Cells>& cells) {
    for (std::uint32_t m = 0; m < cells.size(); ++m)
      for (const Vec3i cell : cells[m])
        for (int i = 0; i < 27; ++i) {
          const Vec3i beside = cell + Vec3i{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
          if (const std::uint32_t* other = first_.find(cell_key(beside))) join(m, *other);
        }
  }

  std::span<const Mesh* const> meshes_;
  float per_cell_, reach_m_;
  kit::DisjointSets sets_;
  kit::PairMap first_{1024};                     // cell → a mesh with surface there
  std::vector<std::vector<NearbyMesh>> nearby_;  // [meshes]
  std::vector<std::uint8_t> is_huge_;            // [meshes] has a triangle too large for the grid
};

}  // namespace

std::vector<std::vector<std::uint32_t>> connected_groups(std::span<const Mesh* const> meshes,
                                                         double reach_m) {
  const auto count = static_cast<std::uint32_t>(meshes.size());
  Grouping grouping(meshes, reach_m);
  if (count > kFew)
    grouping.run();
  else
    for (std::uint32_t m = 1; m < count; ++m) grouping.join(0, m);
  std::vector<std::vector<std::uint32_t>> of_root(count), out;
  for (std::uint32_t m = 0; m < count; ++m) of_root[grouping.of(m)].push_back(m);
  for (std::vector<std::uint32_t>& group : of_root)
    if (!group.empty()) out.push_back(std::move(group));  // a set goes by its lowest: in order
  return out;
}

}  // namespace mr::merge
