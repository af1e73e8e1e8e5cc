#include "mr/fusion/marching_cubes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::fusion {
namespace {

constexpr std::size_t kBlocksAtOnce = 64, kAhead = 2;

const VoxelBlock kUnseen{};
const BlockSurface kEmpty{};

/// The slots of a block's neighbours towards larger (1) or smaller (-1) coordinates.
std::array<std::uint32_t, 8> neighbours(const BlockDirectory& directory, Vec3i block,
                                        int direction) {
  std::array<std::uint32_t, 8> out;
  const Vec3i region = BlockDirectory::region_of(block);
  const BlockDirectory::Region& home = *directory.find_region(region);
  for (int i = 0; i < 8; ++i) {
    const Vec3i at = block + Vec3i{i & 1, i >> 1 & 1, i >> 2} * direction;
    out[i] = BlockDirectory::region_of(at) == region
                 ? home.slots[BlockDirectory::place_in_region(at)]
                 : directory.find(at);
  }
  return out;
}

/// Calls work(group, first, last) for groups of blocks, in parallel.
template <typename Work>
void for_groups(std::size_t blocks, const Work& work) {
  const std::size_t groups = (blocks + kBlocksAtOnce - 1) / kBlocksAtOnce;
  parallel_for(groups, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g)
      work(g, g * kBlocksAtOnce, std::min((g + 1) * kBlocksAtOnce, blocks));
  });
}

/// Prefetches memory that is needed soon: the order of blocks is unpredictable for the CPU.
template <typename T>
void prefetch(const T& object) {
  constexpr std::size_t kLine = 64;
  const auto* const bytes = reinterpret_cast<const char*>(&object);
  for (std::size_t i = 0; i < sizeof(T); i += kLine) __builtin_prefetch(bytes + i);
}

std::size_t count_cells(const BlockSurface& surface) {
  std::size_t count = 0;
  for (const std::uint64_t layer : surface.cells) count += std::popcount(layer);
  return count;
}

/// Whether vertices may coincide: those of one cell are at least 1/256 voxel apart, which far from
/// the origin is below the resolution of float.
bool may_coincide(const VoxelVolume& volume) {
  double farthest_m = 0;
  for (const BlockDirectory::Region& r : volume.directory().regions())
    for (int axis = 0; axis < 3; ++axis)
      farthest_m =
          std::max(farthest_m, (std::abs(r.coordinate[axis]) + 1.0) * BlockDirectory::kRegionSide *
                                   VoxelBlock::kSide * volume.config().voxel_m);
  constexpr double kFloatSteps = 1 << 22;
  return farthest_m > volume.config().voxel_m / 256 * kFloatSteps;
}

/// Removes triangles with two equal corners and updates the pieces.
void drop_degenerate(Surface& surface) {
  Mesh& mesh = surface.mesh;
  std::uint32_t kept = 0;
  for (SurfacePiece& piece : surface.pieces) {
    const std::uint32_t first = kept;
    for (std::uint32_t t = piece.first_triangle; t < piece.first_triangle + piece.triangles; ++t)
      if (length(mesh.area_normal(t)) > 0) mesh.triangles[kept++] = mesh.triangles[t];
    piece.first_triangle = first, piece.triangles = kept - first;
  }
  mesh.triangles.resize(kept);
}

}  // namespace

Around<VoxelBlock> MarchingCubes::blocks_ahead(const VoxelVolume& volume,
                                               std::uint32_t slot) const {
  Around<VoxelBlock> out;
  for (int i = 0; i < 8; ++i) {
    const std::uint32_t other = ahead_[slot][i];
    out[i] = other == BlockDirectory::kNone ? &kUnseen : &volume.block(other);
  }
  return out;
}

Around<BlockSurface> MarchingCubes::surfaces(const Slots& slots) const {
  Around<BlockSurface> out;
  for (int i = 0; i < 8; ++i)
    out[i] = slots[i] == BlockDirectory::kNone ? &kEmpty : &surface_[slots[i]];
  return out;
}

/// Finds the cells with triangles and the edges with vertices.
void MarchingCubes::find(const VoxelVolume& volume) {
  const auto order = volume.order();
  const auto slots_of = [&](std::uint32_t slot, int direction) {
    return neighbours(volume.directory(), volume.block(slot).coordinate, direction);
  };
  surface_.resize(volume.slots()), ahead_.resize(volume.slots());
  cells_.resize((order.size() + kBlocksAtOnce - 1) / kBlocksAtOnce);
  for_groups(order.size(), [&](std::size_t g, std::size_t first, std::size_t last) {
    cells_[g].clear();
    for (std::size_t b = first; b < last; ++b) {
      const std::uint32_t slot = order[b];
      if (b + kAhead < order.size()) {
        const VoxelBlock& soon = volume.block(order[b + kAhead]);
        prefetch(soon.seen), prefetch(soon.inside), prefetch(soon.near);
      }
      ahead_[slot] = slots_of(slot, 1);
      find_cells(blocks_ahead(volume, slot), edges_ == DepthEdges::cut, surface_[slot], cells_[g]);
    }
  });
  for_groups(order.size(), [&](std::size_t, std::size_t first, std::size_t last) {
    for (std::size_t b = first; b < last; ++b) {
      const std::uint32_t slot = order[b];
      find_edges(blocks_ahead(volume, slot), surfaces(slots_of(slot, -1)), surface_[slot]);
    }
  });
}

/// Prefix sums: the first vertex and triangle number of each block.
void MarchingCubes::number(const VoxelVolume& volume) {
  vertices_ = triangles_ = 0;
  for (const std::uint32_t slot : volume.order()) {
    surface_[slot].first_vertex = vertices_, surface_[slot].first_triangle = triangles_;
    vertices_ += surface_[slot].vertices, triangles_ += surface_[slot].triangles;
  }
}

void MarchingCubes::emit(const VoxelVolume& volume, Mesh& out) const {
  const auto order = volume.order();
  out.positions.resize(vertices_), out.triangles.resize(triangles_), clear_labels(out);
  if (triangles_ == 0) return;
  std::uint32_t* const corners = out.triangles.data()->data();
  for_groups(order.size(), [&](std::size_t g, std::size_t first, std::size_t last) {
    std::span<const Cell> cells(cells_[g]);
    const BlockSurface& final = surface_[order[last - 1]];
    const std::uint32_t* const end = corners + 3 * (final.first_triangle + final.triangles);
    for (std::size_t b = first; b < last; ++b) {
      const std::uint32_t slot = order[b];
      const BlockSurface& s = surface_[slot];
      if (b + kAhead < order.size() && surface_[order[b + kAhead]].vertices != 0)
        prefetch(volume.block(order[b + kAhead]).distance);
      if (s.vertices == 0 && s.triangles == 0) continue;
      const std::size_t count = count_cells(s);
      emit_block(blocks_ahead(volume, slot), surfaces(ahead_[slot]), cells.first(count),
                 volume.config().voxel_m, out.positions.data(), corners + 3 * s.first_triangle,
                 end);
      cells = cells.subspan(count);
    }
  });
}

void MarchingCubes::run(const VoxelVolume& volume, Surface& out) {
  find(volume);
  number(volume);
  emit(volume, out.mesh);
  out.pieces.clear();
  for (const ChunkBlocks& chunk : volume.chunks()) {
    const BlockSurface& first = surface_[volume.order()[chunk.first]];
    const BlockSurface& last = surface_[volume.order()[chunk.first + chunk.count - 1]];
    const SurfacePiece piece{
        chunk.cube, first.first_vertex, last.first_vertex + last.vertices - first.first_vertex,
        first.first_triangle, last.first_triangle + last.triangles - first.first_triangle};
    if (piece.vertices + piece.triangles > 0) out.pieces.push_back(piece);
  }
  if (may_coincide(volume)) drop_degenerate(out);
}

Mesh extract_surface(const VoxelVolume& volume, DepthEdges edges) {
  Surface out;
  MarchingCubes(edges).run(volume, out);
  return std::move(out.mesh);
}

}  // namespace mr::fusion
