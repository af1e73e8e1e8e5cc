#include "mr/merge/overlap/second_layers.h"

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/kit/pair_map.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "mr/merge/cell.h"

namespace mr::merge {
namespace {

constexpr float kFacesAlike = 0.5f;  // cosine
constexpr float kCell_nears = 4;     // edge of a cell
constexpr float kMostCells = 64;     // around a triangle; a larger one is looked at in quarters
constexpr int kMostQuarterings = 6;  // what is larger even then counts as near everything

/// The place of each component among those of all parts, by area: [parts][triangles].
std::vector<std::vector<std::uint32_t>> component_ranks(std::span<const Mesh> parts) {
  std::vector<kit::Components> components(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) components[i] = kit::components(parts[i]);
  });
  std::vector<std::tuple<double, std::uint32_t, std::uint32_t>> order;  // area, part, component
  std::vector<std::vector<std::uint32_t>> rank(parts.size()), out(parts.size());
  for (std::uint32_t i = 0; i < parts.size(); ++i) {
    rank[i].resize(components[i].area_m2.size());
    for (std::uint32_t c = 0; c < rank[i].size(); ++c)
      order.emplace_back(components[i].area_m2[c], i, c);
  }
  std::ranges::sort(order);
  for (std::uint32_t r = 0; r < order.size(); ++r)
    rank[std::get<1>(order[r])][std::get<2>(order[r])] = r;
  for (std::uint32_t i = 0; i < parts.size(); ++i)
    for (const std::uint32_t c : components[i].of_triangle) out[i].push_back(rank[i][c]);
  return out;
}

/// The lowest and the highest component in each cell of space.
class ComponentCells {
 public:
  explicit ComponentCells(float near_m)
      : margin_{near_m, near_m, near_m}, per_cell_(1 / (kCell_nears * near_m)) {}

  void add(const Mesh& mesh, std::size_t t, std::uint32_t rank) {
    is_any_huge_ |= !for_each_cell(mesh, t, {}, [&](std::uint64_t key) {
      const auto fresh = static_cast<std::uint32_t>(cells_.size());
      const std::uint32_t at = place_.get_or_add(key, fresh);
      if (at == fresh) cells_.push_back({rank, rank});
      cells_[at].lowest = std::min(cells_[at].lowest, rank);
      cells_[at].highest = std::max(cells_[at].highest, rank);
    });
  }

  /// Which components there may be within reach of a triangle of another one.
  struct Around {
    bool lower = false, higher = false;
  };
  Around around(const Mesh& mesh, std::size_t t, std::uint32_t rank) const {
    if (is_any_huge_) return {true, true};
    Around out;
    for_each_cell(mesh, t, margin_, [&](std::uint64_t key) {
      const std::uint32_t* at = place_.find(key);
      if (at) out.lower |= cells_[*at].lowest<rank, out.higher |= cells_[*at].highest> rank;
    });
    return out;
  }

 private:
  struct Cell {
    std::uint32_t lowest, highest;
  };

  /// False: the triangle is too large.
  template <typename Work>
  bool for_each_cell(const Mesh& mesh, std::size_t t, Vec3f margin, const Work& work) const {
    return for_each_cell(mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2), margin, 0, work);
  }
  template <typename Work>
  bool for_each_cell(Vec3f a, Vec3f b, Vec3f c, Vec3f margin, int quarterings,
                     const Work& work) const {
    const Vec3i low = cell_at((min(min(a, b), c) - margin) * per_cell_),
                high = cell_at((max(max(a, b), c) + margin) * per_cell_);
    const Vec3f size = vec_cast<float>(high - low) + Vec3f{1, 1, 1};
    if (size.x * size.y * size.z <= kMostCells) {
      for (int x = low.x; x <= high.x; ++x)
        for (int y = low.y; y <= high.y; ++y)
          for (int z = low.z; z <= high.z; ++z) work(cell_key({x, y, z}));
      return true;
    }
    if (quarterings == kMostQuarterings) return false;
    const Vec3f ab = (a + b) * 0.5f, bc = (b + c) * 0.5f, ca = (c + a) * 0.5f;
    const auto quarter = [&](Vec3f p, Vec3f q, Vec3f r) {
      return for_each_cell(p, q, r, margin, quarterings + 1, work);
    };
    return quarter(a, ab, ca) && quarter(ab, b, bc) && quarter(ca, bc, c) && quarter(ab, bc, ca);
  }

  Vec3f margin_;
  float per_cell_;
  kit::PairMap place_{1024};
  std::vector<Cell> cells_;
  bool is_any_huge_ = false;
};

/// Triangles of a part that may lie over other surface, and those that others may lie over.
struct NearOthers {
  std::vector<std::uint32_t> over;
  Mesh under;
  std::vector<std::uint32_t> under_rank;  ///< [T of under]
};

NearOthers near_others(const Mesh& part, const std::vector<std::uint32_t>& rank,
                       const ComponentCells& cells) {
  NearOthers out;
  for (std::uint32_t t = 0; t < part.triangles.size(); ++t) {
    const auto [lower, higher] = cells.around(part, t, rank[t]);
    if (higher) out.over.push_back(t);
    if (lower) out.under.triangles.push_back(part.triangles[t]), out.under_rank.push_back(rank[t]);
  }
  if (!out.under.triangles.empty()) out.under.positions = part.positions;
  return out;
}

}  // namespace

void remove_second_layers(std::span<Mesh> parts, double near_m) {
  const auto reach_m = static_cast<float>(near_m);
  const auto for_all_parts = [&](const auto& work) {
    parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) work(i);
    });
  };
  const std::vector<std::vector<std::uint32_t>> rank = component_ranks(parts);
  ComponentCells cells(reach_m);
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (std::size_t t = 0; t < rank[i].size(); ++t) cells.add(parts[i], t, rank[i][t]);
  std::vector<NearOthers> near(parts.size());
  for_all_parts([&](std::size_t i) { near[i] = near_others(parts[i], rank[i], cells); });

  std::vector<const Mesh*> under;
  for (const NearOthers& part : near) under.push_back(&part.under);
  const kit::RayScene rays(under);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Mesh& part = parts[i];
    const std::vector<std::uint32_t>& over = near[i].over;
    std::vector<std::uint8_t> keep(part.triangles.size(), 1);
    parallel_for(over.size(), 256, [&](std::size_t begin, std::size_t end) {
      std::vector<kit::RayHit> hits;
      for (std::size_t k = begin; k < end; ++k) {
        const Vec3f normal = normalized(part.area_normal(over[k]));
        rays.all_hits(part.centroid(over[k]), normal, -reach_m, reach_m, hits);
        keep[over[k]] = std::ranges::none_of(hits, [&](const kit::RayHit& hit) {
          const NearOthers& other = near[hit.mesh];
          return other.under_rank[hit.triangle] > rank[i][over[k]] &&
                 dot(normalized(other.under.area_normal(hit.triangle)), normal) >= kFacesAlike;
        });
      }
    });
    if (std::ranges::find(keep, 0) != keep.end()) parts[i] = select_triangles(part, keep);
  }
}

}  // namespace mr::merge
