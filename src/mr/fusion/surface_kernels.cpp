#include "mr/fusion/surface_kernels.h"

#include <algorithm>
#include <bit>

#include "mr/fusion/marching_cubes_table.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mr/fusion/surface_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/highway.h>

#ifndef MR_FUSION_CELL_TABLE
#define MR_FUSION_CELL_TABLE
namespace mr::fusion {

/// Vertices of a block's cells by edge, also of those edges that belong to blocks ahead: edge of
/// voxel (x, y, z) along `axis`, each coordinate up to 8.
struct VertexIds {
  static constexpr int kY = 9, kZ = 81, kAxis = 729;
  static constexpr int at(int axis, int x, int y, int z) {
    return axis * kAxis + z * kZ + y * kY + x;
  }
  std::array<std::uint32_t, 3 * kAxis> id;
};

/// The triangles of a marching cubes case: offsets of their edges in VertexIds from the cell's.
struct CellCase {
  std::uint16_t corners = 0;
  std::array<std::uint16_t, 15> edge{};
};

inline const std::array<CellCase, 256>& cell_cases() {
  static const std::array<CellCase, 256> cases = [] {
    std::array<CellCase, 256> out;
    for (int c = 0; c < 256; ++c) {
      for (const auto& triangle : cell_triangles()[c])
        for (const int e : triangle) {
          const auto [low, axis] = kCellEdges[e];
          out[c].edge[out[c].corners++] =
              static_cast<std::uint16_t>(VertexIds::at(axis, low & 1, low >> 1 & 1, low >> 2 & 1));
        }
      for (std::size_t i = out[c].corners; i < out[c].edge.size(); ++i)
        out[c].edge[i] = out[c].edge[0];  // padding: any valid offset
    }
    return out;
  }();
  return cases;
}

}  // namespace mr::fusion
#endif

HWY_BEFORE_NAMESPACE();
namespace mr::fusion::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kSide = VoxelBlock::kSide;
using Bits = VoxelBlock::Bits;
constexpr std::uint64_t kLastColumn = 0x8080808080808080u, kFirstColumn = 0x0101010101010101u;

/// A block's bits and the layer after them: [z], z up to 8.
using Layers = std::array<std::uint64_t, kSide + 1>;

/// One kind of bits of all voxels at the four corners of each cell's face towards lower z:
/// [dy·2 + dx][z] bit = the bit of the voxel that is (dx, dy) further.
using Corners = std::array<Layers, 4>;

HWY_INLINE void layers_of(const Around<VoxelBlock>& ahead, Bits VoxelBlock::*bits, int place,
                          Layers& out) {
  const Bits& own = ahead[place]->*bits;
  for (int z = 0; z < kSide; ++z) out[z] = own[z];
  out[kSide] = (ahead[place | 4]->*bits)[0];
}

HWY_INLINE void corners_of(const Around<VoxelBlock>& ahead, Bits VoxelBlock::*bits, Corners& out) {
  Layers here, x, y, xy;
  layers_of(ahead, bits, 0, here);
  layers_of(ahead, bits, 1, x);
  layers_of(ahead, bits, 2, y);
  layers_of(ahead, bits, 3, xy);
  for (int z = 0; z <= kSide; ++z) {
    out[0][z] = here[z];
    out[1][z] = (here[z] >> 1 & ~kLastColumn) | (x[z] << 7 & kLastColumn);
    const std::uint64_t ahead_y = (y[z] >> 1 & ~kLastColumn) | (xy[z] << 7 & kLastColumn);
    out[2][z] = here[z] >> kSide | y[z] << (64 - kSide);
    out[3][z] = out[1][z] >> kSide | ahead_y << (64 - kSide);
  }
}

/// Cells with all corners seen, some inside and some not.
HWY_INLINE std::uint64_t mixed_cells(const Around<VoxelBlock>& ahead, const Corners& inside,
                                     Bits& out) {
  std::uint64_t found = 0;
  for (int z = 0; z < kSide; ++z) {
    std::uint64_t any = 0, all = ~std::uint64_t{0};
    for (const Layers& c : inside) any |= c[z] | c[z + 1], all &= c[z] & c[z + 1];
    found |= out[z] = any & ~all;
  }
  if (found == 0) return 0;
  Corners seen;
  corners_of(ahead, &VoxelBlock::seen, seen);
  found = 0;
  for (int z = 0; z < kSide; ++z) {
    for (const Layers& c : seen) out[z] &= c[z] & c[z + 1];
    found |= out[z];
  }
  return found;
}

/// Removes cells with an edge between the inside and free space beyond the band: a depth
/// discontinuity, not a surface.
HWY_INLINE void drop_discontinuities(const Corners& inside, const Corners& near, Bits& cells) {
  const auto torn = [&](int a, int b, int z) {
    return (inside[a][z] ^ inside[b][z]) & ~(near[a][z] & near[b][z]);
  };
  Layers flat;  // along x and y
  for (int z = 0; z <= kSide; ++z)
    flat[z] = torn(0, 1, z) | torn(2, 3, z) | torn(0, 2, z) | torn(1, 3, z);
  for (int z = 0; z < kSide; ++z) {
    std::uint64_t up = 0;
    for (int c = 0; c < 4; ++c)
      up |= (inside[c][z] ^ inside[c][z + 1]) & ~(near[c][z] & near[c][z + 1]);
    cells[z] &= ~(flat[z] | flat[z + 1] | up);
  }
}

/// The inside corners of a layer's 64 cells.
HWY_INLINE void cases_of_layer(const Corners& inside, int z, std::uint8_t* out) {
  const hn::CappedTag<std::uint8_t, 64> d8;
  using D8 = decltype(d8);
  for (std::size_t i = 0; i < 64; i += hn::Lanes(d8)) {
    auto sum = hn::Zero(d8);
    for (int c = 0; c < 8; ++c) {
      std::uint64_t word[2] = {inside[c & 3][z + (c >> 2)] >> i, 0};
      const auto mask = hn::LoadMaskBits(d8, reinterpret_cast<const std::uint8_t*>(word));
      sum = hn::Or(sum, hn::IfThenElseZero(mask, hn::Set(d8, static_cast<hn::TFromD<D8>>(1 << c))));
    }
    hn::StoreU(sum, d8, out + i);
  }
}

void FindCells(const Around<VoxelBlock>& ahead, bool cut, BlockSurface& surface,
               std::vector<Cell>& list) {
  surface.cells = {}, surface.triangles = 0;
  Corners inside;
  corners_of(ahead, &VoxelBlock::inside, inside);
  if (mixed_cells(ahead, inside, surface.cells) == 0) return;
  if (cut) {
    Corners near;
    corners_of(ahead, &VoxelBlock::near, near);
    drop_discontinuities(inside, near, surface.cells);
  }
  const auto& cases = cell_cases();
  unsigned corners = 0;
  for (int z = 0; z < kSide; ++z) {
    std::uint64_t rest = surface.cells[z];
    if (rest == 0) continue;
    alignas(64) std::uint8_t inside_of[64];
    cases_of_layer(inside, z, inside_of);
    std::size_t at = list.size();
    list.resize(at + std::popcount(rest));
    for (; rest != 0; rest &= rest - 1) {
      const int bit = std::countr_zero(rest);
      list[at++] = static_cast<Cell>((z * 64 + bit) << 8 | inside_of[bit]);
      corners += cases[inside_of[bit]].corners;
    }
  }
  surface.triangles = static_cast<std::uint16_t>(corners / 3);
}

void FindEdges(const Around<VoxelBlock>& ahead, const Around<BlockSurface>& behind,
               BlockSurface& surface) {
  // Cells before each cell: along x, y, and both; one layer more below.
  Layers own, x, y, xy;
  const auto layers_behind = [&](int place, Layers& out) {
    out[0] = behind[place | 4]->cells[kSide - 1];
    for (int z = 0; z < kSide; ++z) out[z + 1] = behind[place]->cells[z];
  };
  layers_behind(0, own), layers_behind(1, x), layers_behind(2, y), layers_behind(3, xy);
  std::uint64_t any = 0;
  for (int z = 0; z <= kSide; ++z) any |= own[z] | x[z] | y[z] | xy[z];
  if (any == 0) {
    surface.edges = {}, surface.first = {}, surface.vertices = 0;
    return;
  }
  unsigned count = 0;
  Layers back_x, back_y;  // the cell itself or the one before it
  for (int z = 0; z <= kSide; ++z) {
    back_x[z] = own[z] | (own[z] << 1 & ~kFirstColumn) | (x[z] >> 7 & kFirstColumn);
    back_y[z] = own[z] | own[z] << kSide | y[z] >> (64 - kSide);
  }
  Layers inside;
  layers_of(ahead, &VoxelBlock::inside, 0, inside);
  for (int z = 0; z < kSide; ++z) {
    const std::uint64_t in = inside[z];
    const std::uint64_t next_x =
        (in >> 1 & ~kLastColumn) | (ahead[1]->inside[z] << 7 & kLastColumn);
    const std::uint64_t next_y = in >> kSide | ahead[2]->inside[z] << (64 - kSide);
    surface.edges[0][z] = (in ^ next_x) & (back_y[z] | back_y[z + 1]);
    surface.edges[1][z] = (in ^ next_y) & (back_x[z] | back_x[z + 1]);
    const std::uint64_t x_or_own = back_x[z + 1];
    const std::uint64_t before_y =
        (y[z + 1] | (y[z + 1] << 1 & ~kFirstColumn) | (xy[z + 1] >> 7 & kFirstColumn));
    surface.edges[2][z] =
        (in ^ inside[z + 1]) & (x_or_own | x_or_own << kSide | before_y >> (64 - kSide));
  }
  for (int axis = 0; axis < 3; ++axis)
    for (int z = 0; z < kSide; ++z) {
      surface.first[axis][z] = static_cast<std::uint16_t>(count);
      count += static_cast<unsigned>(std::popcount(surface.edges[axis][z]));
    }
  surface.vertices = static_cast<std::uint16_t>(count);
}

/// Records the numbers of the vertices selected by `mask` on edges along `axis` in layer z of
/// `from`, a block ahead. `offset`: of that block in VertexIds.
HWY_INLINE void note_ids(const BlockSurface& from, int axis, int z, std::uint64_t mask, int offset,
                         VertexIds& ids) {
  const std::uint64_t all = from.edges[axis][z];
  const std::uint32_t first = from.first_vertex + from.first[axis][z];
  for (std::uint64_t rest = all & mask; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest);
    const std::uint64_t below = (std::uint64_t{1} << bit) - 1;
    ids.id[offset + VertexIds::at(axis, bit & 7, bit >> 3, z)] =
        first + static_cast<std::uint32_t>(std::popcount(all & below));
  }
}

HWY_INLINE void note_ids_ahead(const Around<BlockSurface>& ahead, VertexIds& ids) {
  constexpr std::uint64_t kAll = ~std::uint64_t{0}, kFirstRow = 0xFF;
  constexpr int kX = kSide, kY = kSide * VertexIds::kY, kZ = kSide * VertexIds::kZ;
  if (ahead[1]->vertices != 0)
    for (int z = 0; z < kSide; ++z)
      for (const int axis : {1, 2}) note_ids(*ahead[1], axis, z, kFirstColumn, kX, ids);
  if (ahead[2]->vertices != 0)
    for (int z = 0; z < kSide; ++z)
      for (const int axis : {0, 2}) note_ids(*ahead[2], axis, z, kFirstRow, kY, ids);
  for (const int axis : {0, 1}) note_ids(*ahead[4], axis, 0, kAll, kZ, ids);
  for (int z = 0; z < kSide; ++z) note_ids(*ahead[3], 2, z, 1, kX + kY, ids);
  note_ids(*ahead[5], 1, 0, kFirstColumn, kX + kZ, ids);
  note_ids(*ahead[6], 0, 0, kFirstRow, kY + kZ, ids);
}

/// Position on a grid edge where the surface crosses it, in voxels; never an end, where the
/// vertices of several edges would coincide.
HWY_INLINE float crossing(std::int16_t here, std::int16_t next) {
  constexpr float kLeast = 1.0f / 256;
  const float a = here, b = next;
  return std::clamp(a / (a - b), kLeast, 1 - kLeast);
}

/// Positions of a block's voxels: [axis][index along it], metres.
struct GridLines {
  std::array<std::array<float, kSide>, 3> at;
  float voxel;

  GridLines(Vec3i block, double voxel_m) : voxel(static_cast<float>(voxel_m)) {
    for (int axis = 0; axis < 3; ++axis)
      for (int i = 0; i < kSide; ++i)
        at[axis][i] = static_cast<float>((double{kSide} * block[axis] + i) * voxel_m);
  }
};

template <int kAxis>
HWY_INLINE std::uint32_t emit_vertices_along(const Around<VoxelBlock>& ahead,
                                             const BlockSurface& surface, const GridLines& lines,
                                             std::uint32_t number, VertexIds& ids,
                                             Vec3f* positions) {
  constexpr int kStep = kAxis == 0 ? 1 : kAxis == 1 ? kSide : kSide * kSide;
  for (int z = 0; z < kSide; ++z) {
    // The other ends of the edges that leave the block lie in the next one, seven steps back.
    const bool all_leave = kAxis == 2 && z == kSide - 1;
    const std::uint64_t leaving = kAxis == 0   ? kLastColumn
                                  : kAxis == 1 ? std::uint64_t{0xFF} << 56
                                               : all_leave * ~std::uint64_t{0};
    const std::int16_t* const here = ahead[0]->distance.data() + z * 64;
    const std::int16_t* const ends[2] = {here + kStep,
                                         ahead[1 << kAxis]->distance.data() + z * 64 - 7 * kStep};
    for (std::uint64_t rest = surface.edges[kAxis][z]; rest != 0; rest &= rest - 1) {
      const int bit = std::countr_zero(rest), x = bit & 7, y = bit >> 3;
      const float along = crossing(here[bit], ends[leaving >> bit & 1][bit]) * lines.voxel;
      Vec3f& p = positions[number];
      p = {lines.at[0][x], lines.at[1][y], lines.at[2][z]};
      (kAxis == 0 ? p.x : kAxis == 1 ? p.y : p.z) += along;
      ids.id[VertexIds::at(kAxis, x, y, z)] = number++;
    }
  }
  return number;
}

HWY_INLINE void emit_vertices(const Around<VoxelBlock>& ahead, const BlockSurface& surface,
                              double voxel_m, VertexIds& ids, Vec3f* positions) {
  const GridLines lines(ahead[0]->coordinate, voxel_m);
  std::uint32_t n = surface.first_vertex;
  n = emit_vertices_along<0>(ahead, surface, lines, n, ids, positions);
  n = emit_vertices_along<1>(ahead, surface, lines, n, ids, positions);
  emit_vertices_along<2>(ahead, surface, lines, n, ids, positions);
}

void EmitBlock(const Around<VoxelBlock>& ahead, const Around<BlockSurface>& surface_ahead,
               std::span<const Cell> cells, double voxel_m, Vec3f* positions,
               std::uint32_t* corners, const std::uint32_t* corners_end) {
  VertexIds ids;  // not cleared: cells read only edges that hold a vertex
  const BlockSurface& surface = *surface_ahead[0];
  emit_vertices(ahead, surface, voxel_m, ids, positions);
  if (cells.empty()) return;
  note_ids_ahead(surface_ahead, ids);
  const auto& cases = cell_cases();
  for (const Cell cell : cells) {
    const std::uint32_t voxel = cell >> 8;
    const CellCase& c = cases[cell & 0xFF];
    const std::uint32_t* const id =
        ids.id.data() + VertexIds::at(0, voxel & 7, voxel >> 3 & 7, voxel >> 6);
    // Nearly all cells have up to four triangles: always writes four without a branch; the next
    // cell overwrites the surplus.
    if (corners + 12 <= corners_end && c.corners <= 12)
      for (int k = 0; k < 12; ++k) corners[k] = id[c.edge[k]];
    else
      for (int k = 0; k < c.corners; ++k) corners[k] = id[c.edge[k]];
    corners += c.corners;
  }
}

}  // namespace mr::fusion::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace mr::fusion {

HWY_EXPORT(FindCells);
HWY_EXPORT(FindEdges);
HWY_EXPORT(EmitBlock);

void find_cells(const Around<VoxelBlock>& ahead, bool cut, BlockSurface& surface,
                std::vector<Cell>& list) {
  HWY_DYNAMIC_DISPATCH(FindCells)(ahead, cut, surface, list);
}
void find_edges(const Around<VoxelBlock>& ahead, const Around<BlockSurface>& behind,
                BlockSurface& surface) {
  HWY_DYNAMIC_DISPATCH(FindEdges)(ahead, behind, surface);
}
void emit_block(const Around<VoxelBlock>& ahead, const Around<BlockSurface>& surface_ahead,
                std::span<const Cell> cells, double voxel_m, Vec3f* positions,
                std::uint32_t* corners, const std::uint32_t* corners_end) {
  HWY_DYNAMIC_DISPATCH(EmitBlock)
  (ahead, surface_ahead, cells, voxel_m, positions, corners, corners_end);
}

}  // namespace mr::fusion
#endif
