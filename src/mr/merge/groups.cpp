#include "mr/merge/groups.h"

#include <algorithm>
#include <cmath>
#include <ranges>

#include "mr/core/parallel.h"
#include "mr/kit/pair_map.h"
#include "mr/merge/cell.h"
#include "mr/merge/disjoint_sets.h"
#include "mr/merge/pieces.h"

namespace mr::merge {
namespace {

constexpr std::size_t kFew = 6;       // meshes: merging them together costs less than looking
constexpr double kCell_reaches = 3;   // so that what is within reach, and a piece of a triangle
constexpr float kPiece_cells = 0.5f;  // away from its middle, lies in the next cell at the most
constexpr int kMostPieces = 64;       // of an edge: where a larger triangle lies is not looked at

/// The cells that the middles of a mesh's triangles lie in, or of their pieces.
struct Occupied {
  std::vector<Vec3i> cells;
  bool everywhere = false;
};

Occupied occupied(const Mesh& mesh, float per_cell) {
  Occupied out;
  kit::PairMap known(mesh.triangles.size() / 8);
  Vec3i last{1 << 30, 0, 0};
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f a = mesh.corner(t, 0) * per_cell, ab = mesh.corner(t, 1) * per_cell - a,
                ac = mesh.corner(t, 2) * per_cell - a;
    const float pieces = std::max({length(ab), length(ac), length(ac - ab)}) / kPiece_cells;
    if (!(pieces <= kMostPieces)) return {{}, true};
    for_each_piece(std::max(static_cast<int>(std::ceil(pieces)), 1), [&](float b, float c) {
      const Vec3i cell = cell_at(a + ab * b + ac * c);
      if (cell == last) return;
      last = cell;
      const auto fresh = static_cast<std::uint32_t>(out.cells.size());
      if (known.get_or_add(cell_key(cell), fresh) == fresh) out.cells.push_back(cell);
    });
  }
  return out;
}

/// Joins those with surface in the same cell, then those in cells beside each other.
void join_meeting(const std::vector<Occupied>& meshes, DisjointSets& sets) {
  kit::PairMap first(1024);  // cell → the first mesh there
  for (std::uint32_t m = 0; m < meshes.size(); ++m) {
    if (meshes[m].everywhere)
      for (std::uint32_t other = 0; other < meshes.size(); ++other) sets.join(m, other);
    for (const Vec3i cell : meshes[m].cells) sets.join(m, first.get_or_add(cell_key(cell), m));
  }
  const auto is_apart = [&](std::size_t m) { return sets.of(static_cast<std::uint32_t>(m)) != 0; };
  if (std::ranges::none_of(std::views::iota(std::size_t{0}, meshes.size()), is_apart)) return;
  for (std::uint32_t m = 0; m < meshes.size(); ++m)
    for (const Vec3i cell : meshes[m].cells)
      for (int i = 14; i < 27; ++i) {  // half of the neighbours: the others look this way
        const Vec3i beside = cell + Vec3i{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
        if (const std::uint32_t* other = first.find(cell_key(beside))) sets.join(m, *other);
      }
}

}  // namespace

std::vector<std::vector<std::uint32_t>> groups_that_meet(std::span<const Mesh* const> meshes,
                                                         double reach_m) {
  const auto count = static_cast<std::uint32_t>(meshes.size());
  DisjointSets sets(count);
  if (count <= kFew) {
    for (std::uint32_t m = 1; m < count; ++m) sets.join(0, m);
  } else {
    std::vector<Occupied> cells(count);
    parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t m = begin; m < end; ++m)
        cells[m] = occupied(*meshes[m], static_cast<float>(1 / (kCell_reaches * reach_m)));
    });
    join_meeting(cells, sets);
  }
  std::vector<std::vector<std::uint32_t>> of_root(count), out;
  for (std::uint32_t m = 0; m < count; ++m) of_root[sets.of(m)].push_back(m);
  for (std::vector<std::uint32_t>& group : of_root)
    if (!group.empty()) out.push_back(std::move(group));
  std::ranges::sort(out);
  return out;
}

}  // namespace mr::merge
