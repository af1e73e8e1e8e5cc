#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/fusion/voxel_block.h"

/// The inner loops of marching cubes, compiled for several instruction sets and dispatched at run
/// time (Highway). A cell belongs to the block of its lowest corner, an edge and its vertex to the
/// block of its lower end.
namespace mr::fusion {

/// Counts and masks of a block's surface, computed before vertices and triangles are written.
struct BlockSurface {
  VoxelBlock::Bits cells;                 ///< cells with triangles
  std::array<VoxelBlock::Bits, 3> edges;  ///< [axis] edges with a vertex
  /// Vertices are numbered by axis, layer and bit; [axis][layer] how many come before.
  std::array<std::array<std::uint16_t, VoxelBlock::kSide>, 3> first;
  std::uint32_t first_vertex, first_triangle;  ///< in the mesh
  std::uint16_t vertices, triangles;           ///< their number
};

/// A cell that holds triangles: its voxel's index << 8 | its corners that are inside.
using Cell = std::uint32_t;

/// A block's neighbourhood: bit `axis` of the index: the next block along that axis; 0: itself.
template <typename Block>
using Around = std::array<const Block*, 8>;

/// Finds a block's cells, appends them to `list` and sets `cells` and `triangles`. `cut`:
/// omits cells in which the inside borders on free space beyond the band.
void find_cells(const Around<VoxelBlock>& ahead, bool cut, BlockSurface& surface,
                std::vector<Cell>& list);

/// Finds the edges that cells of the block or of those behind it use. `ahead`: 1, 2 and 4 are used;
/// `behind`: bit `axis` set: the one before along that axis; 7 is not used.
void find_edges(const Around<VoxelBlock>& ahead, const Around<BlockSurface>& behind,
                BlockSurface& surface);

/// Writes a block's vertices into the mesh's `positions`, and its triangles, as vertex numbers,
/// from `corners` on. Memory behind them may be overwritten up to `corners_end`.
void emit_block(const Around<VoxelBlock>& ahead, const Around<BlockSurface>& surface_ahead,
                std::span<const Cell> cells, double voxel_m, Vec3f* positions,
                std::uint32_t* corners, const std::uint32_t* corners_end);

}  // namespace mr::fusion
