#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/fusion/surface_kernels.h"
#include "mr/fusion/voxel_volume.h"

namespace mr::fusion {

/// What becomes of cells in which the inside meets free space beyond the truncation band directly.
/// There depth jumps and nobody saw a surface.
enum class DepthEdges {
  cut,     ///< they stay empty
  bridge,  ///< they become surface like any other, as most TSDF libraries do
};

/// A chunk's share of a surface: ranges of its vertices and triangles. Triangles at the border use
/// vertices of the chunks ahead.
struct SurfacePiece {
  Vec3i cube;  ///< in VolumeConfig::chunk_m
  std::uint32_t first_vertex = 0, vertices = 0, first_triangle = 0, triangles = 0;
};

/// The zero surface of a volume.
struct Surface {
  Mesh mesh;                         ///< block by block
  std::vector<SurfacePiece> pieces;  ///< chunks that hold any, in the volume's order; cover `mesh`
};

/// Marching cubes (Lorensen & Cline 1987): vertices shared between cells and blocks, triangles
/// counter-clockwise seen from the free side, none degenerate, no edge with more than two. Cells of
/// which a corner was never seen stay empty. Works on bits, 64 voxels at a time, and touches
/// distances only where the surface crosses an edge of the grid. Parallel; the same bytes on any
/// number of threads and with any SIMD target. Keeps its memory from call to call.
class MarchingCubes {
 public:
  explicit MarchingCubes(DepthEdges edges = DepthEdges::cut) : edges_(edges) {}

  /// The whole surface; what `out` held is replaced, its memory used again.
  void run(const VoxelVolume& volume, Surface& out);

 private:
  using Slots = std::array<std::uint32_t, 8>;

  void find(const VoxelVolume& volume);
  void number(const VoxelVolume& volume);
  void emit(const VoxelVolume& volume, Mesh& out) const;
  Around<VoxelBlock> blocks_ahead(const VoxelVolume& volume, std::uint32_t slot) const;
  Around<BlockSurface> surfaces(const Slots& slots) const;

  DepthEdges edges_;
  std::vector<BlockSurface> surface_;     ///< [slot]
  std::vector<Slots> ahead_;              ///< [slot]
  std::vector<std::vector<Cell>> cells_;  ///< by group of blocks
  std::uint32_t vertices_ = 0, triangles_ = 0;
};

/// The whole surface, for those who need it once.
Mesh extract_surface(const VoxelVolume& volume, DepthEdges edges = DepthEdges::cut);

}  // namespace mr::fusion
