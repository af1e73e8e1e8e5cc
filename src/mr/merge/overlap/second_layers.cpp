#include "mr/merge/overlap/second_layers.h"

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <numeric>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/kit/pair_map.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "mr/merge/cell.h"

namespace mr::merge {
namespace {

constexpr float kFacesAlike = 0.5f;   // cosine
constexpr float kLarge_nears = 1.5f;  // edge of a triangle that is looked at near its corners, too
constexpr float kToCorner = 0.9f;     // of the way from the centroid
constexpr float kCell_nears = 4;      // edge of a cell
constexpr float kMostCells = 64;      // around a triangle; a larger one is looked at in quarters
constexpr int kMostQuarterings = 6;   // what is larger even then counts as near everything

/// Surface of one sensor within a component, and its precedence where it lies over another one.
struct Sheet {
  double area_m2;  ///< of the component, at most `large_m2`
  SensorId sensor;
  std::uint32_t component;  ///< among those of all parts

  friend auto operator<=>(const Sheet&, const Sheet&) = default;
};

/// Sheets in ascending order, and each triangle's: [parts][T]. Larger components take precedence.
/// All large ones are alike, so that sensors decide: above a merger that has joined components, the
/// same sheet is to stay.
struct Sheets {
  std::vector<Sheet> sheets;
  std::vector<std::vector<std::uint32_t>> of_triangle;
};

Sheets sheets_of(std::span<const Mesh> parts, double large_m2) {
  std::vector<kit::Components> components(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) components[i] = kit::components(parts[i]);
  });
  Sheets out{{}, std::vector<std::vector<std::uint32_t>>(parts.size())};
  std::vector<Sheet>& sheets = out.sheets;
  kit::PairMap known{1024};  // component and sensor → sheet, in the order of discovery
  std::uint32_t before = 0;  // components of the parts before
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::vector<SensorId> sensor = triangle_sensors(parts[i]);
    for (std::size_t t = 0; t < sensor.size(); ++t) {
      const std::uint32_t c = components[i].of_triangle[t];
      const auto fresh = static_cast<std::uint32_t>(sheets.size());
      const std::uint64_t key = std::uint64_t{before + c} << 32 | number_of(sensor[t]);
      const std::uint32_t sheet = known.get_or_add(key, fresh);
      if (sheet == fresh)
        sheets.push_back({std::min(components[i].area_m2[c], large_m2), sensor[t], before + c});
      out.of_triangle[i].push_back(sheet);
    }
    before += static_cast<std::uint32_t>(components[i].area_m2.size());
  }
  std::vector<std::uint32_t> order(sheets.size()), place(sheets.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::sort(order, {}, [&](std::uint32_t sheet) { return sheets[sheet]; });
  std::ranges::sort(sheets);
  for (std::uint32_t k = 0; k < order.size(); ++k) place[order[k]] = k;
  for (std::vector<std::uint32_t>& of_triangle : out.of_triangle)
    for (std::uint32_t& sheet : of_triangle) sheet = place[sheet];
  return out;
}

/// The lowest and the highest sheet in each cell of space.
class SheetCells {
 public:
  explicit SheetCells(float near_m)
      : margin_{near_m, near_m, near_m}, per_cell_(1 / (kCell_nears * near_m)) {}

  void add(const Mesh& mesh, std::size_t t, std::uint32_t sheet) {
    is_any_huge_ |= !for_each_cell(mesh, t, {}, [&](std::uint64_t key) {
      const auto fresh = static_cast<std::uint32_t>(cells_.size());
      const std::uint32_t at = place_.get_or_add(key, fresh);
      if (at == fresh) cells_.push_back({sheet, sheet});
      cells_[at].lowest = std::min(cells_[at].lowest, sheet);
      cells_[at].highest = std::max(cells_[at].highest, sheet);
    });
  }

  /// Which sheets there may be within reach of a triangle of another one.
  struct Around {
    bool lower = false, higher = false;
  };
  Around around(const Mesh& mesh, std::size_t t, std::uint32_t sheet) const {
    if (is_any_huge_) return {true, true};
    Around out;
    for_each_cell(mesh, t, margin_, [&](std::uint64_t key) {
      const std::uint32_t* at = place_.find(key);
      if (at) out.lower |= cells_[*at].lowest<sheet, out.higher |= cells_[*at].highest> sheet;
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
    const CellBox cells{cell_at((min(min(a, b), c) - margin) * per_cell_),
                        cell_at((max(max(a, b), c) + margin) * per_cell_)};
    if (cells.count() <= kMostCells) {
      cells.for_each(work);
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
  std::vector<std::uint32_t> under_sheet;  ///< [T of under]
};

NearOthers near_others(const Mesh& part, const std::vector<std::uint32_t>& sheet,
                       const SheetCells& cells) {
  NearOthers out;
  for (std::uint32_t t = 0; t < part.triangles.size(); ++t) {
    const auto [lower, higher] = cells.around(part, t, sheet[t]);
    if (higher) out.over.push_back(t);
    if (lower)
      out.under.triangles.push_back(part.triangles[t]), out.under_sheet.push_back(sheet[t]);
  }
  if (!out.under.triangles.empty()) out.under.positions = part.positions;
  return out;
}

/// Whether `is_covered(point)` holds all over a triangle: in its middle and, if it is large, near
/// its corners.
template <typename IsCovered>
bool is_covered_all_over(const Mesh& mesh, std::size_t t, float near_m,
                         const IsCovered& is_covered) {
  const Vec3f a = mesh.corner(t, 0), b = mesh.corner(t, 1), c = mesh.corner(t, 2);
  const Vec3f middle = mesh.centroid(t);
  if (!is_covered(middle)) return false;
  if (std::max({length(b - a), length(c - b), length(a - c)}) <= kLarge_nears * near_m) return true;
  return std::ranges::all_of(std::array{a, b, c}, [&](Vec3f corner) {
    return is_covered(middle + (corner - middle) * kToCorner);
  });
}

}  // namespace

void remove_second_layers(std::span<Mesh> parts, const SecondLayersConfig& config) {
  if (config.apart_m <= 0) return;
  const auto reach_m = static_cast<float>(config.apart_m);
  const auto for_all_parts = [&](const auto& work) {
    parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) work(i);
    });
  };
  const Sheets found = sheets_of(parts, config.large_m2);
  const std::vector<Sheet>& sheets = found.sheets;
  const std::vector<std::vector<std::uint32_t>>& sheet = found.of_triangle;
  SheetCells cells(reach_m);
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (std::size_t t = 0; t < sheet[i].size(); ++t) cells.add(parts[i], t, sheet[i][t]);
  std::vector<NearOthers> near(parts.size());
  for_all_parts([&](std::size_t i) { near[i] = near_others(parts[i], sheet[i], cells); });

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
        const std::uint32_t own = sheet[i][over[k]];
        const Vec3f normal = normalized(part.area_normal(over[k]));
        keep[over[k]] = !is_covered_all_over(part, over[k], reach_m, [&](Vec3f p) {
          rays.all_hits(p, normal, -reach_m, reach_m, hits);
          return std::ranges::any_of(hits, [&](const kit::RayHit& hit) {
            const NearOthers& there = near[hit.mesh];
            const std::uint32_t other = there.under_sheet[hit.triangle];
            return other > own && sheets[other].component != sheets[own].component &&
                   (hit.mesh != i || sheets[other].sensor != sheets[own].sensor) &&
                   dot(normalized(there.under.area_normal(hit.triangle)), normal) >= kFacesAlike;
          });
        });
      }
    });
    if (std::ranges::find(keep, 0) != keep.end()) parts[i] = select_triangles(part, keep);
  }
}

}  // namespace mr::merge
