#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/fusion/surface_kernels.h"
#include "mr/fusion/voxel_volume.h"

namespace mr::fusion {

/// Treatment of cells with a corner behind a surface next to one in free space beyond the
/// truncation band. They occur at depth discontinuities, where no surface was measured.
enum class DepthEdges {
  cut,     ///< no surface there
  bridge,  ///< polygonized like other cells, as most TSDF libraries do
};

/// The ranges of a surface's vertices and triangles that belong to one chunk. Triangles at its
/// border use vertices of neighbouring chunks in +x, +y and +z.
struct SurfacePiece {
  Vec3i cube;  ///< in VolumeConfig::chunk_m
  std::uint32_t first_vertex = 0, vertices = 0, first_triangle = 0, triangles = 0;
};

/// The zero level set of a volume.
struct Surface {
  Mesh mesh;                         ///< block by block
  std::vector<SurfacePiece> pieces;  ///< chunks that hold any, in the volume's order; cover `mesh`
};

/// Marching cubes (Lorensen and Cline 1987). Vertices are shared between cells and blocks;
/// triangles are counter-clockwise seen from free space, none is degenerate, and no edge has more
/// than two. Cells with a corner that was never observed stay empty. Classifies cells by bit masks,
/// 64 voxels at a time, and reads distances only at grid edges that the surface crosses. Parallel;
/// the same bytes on any number of threads and with any SIMD target. Keeps its memory from call to
/// call.
class MarchingCubes {
 public:
  explicit MarchingCubes(DepthEdges edges = DepthEdges::cut) : edges_(edges) {}

  /// Extracts the whole surface into `out`, whose memory is reused.
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

/// Extracts the whole surface once.
Mesh extract_surface(const VoxelVolume& volume, DepthEdges edges = DepthEdges::cut);

}  // namespace mr::fusion
