#include "mr/fusion/marching_cubes.h"

#include <array>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/fusion/marching_cubes_table.h"

namespace mr::fusion {
namespace {

constexpr int kSide = VoxelBlock::kSide;
constexpr std::int16_t kNoVertex = -1;
constexpr std::uint32_t kNoBlock = 0xFFFFFFFFu;

/// Surface vertices on the edges that start at a block's voxels.
struct BlockVertices {
  std::array<std::int16_t, VoxelBlock::kVoxels * 3> index;  ///< [voxel, axis] place in `positions`
  std::vector<Vec3f> positions;
  std::uint32_t first = 0;  ///< of its positions in the mesh
};

/// A block and its seven neighbours towards larger coordinates; null where not allocated.
struct Neighbourhood {
  std::array<std::uint32_t, 8> block;
};

struct Voxel {
  std::uint32_t block;  ///< kNoBlock: not allocated
  int index;
};

/// Voxel (x, y, z) of a block, where one past the block's end is in a neighbour.
Voxel voxel_at(const Neighbourhood& n, int x, int y, int z) {
  const int which = (x >= kSide) | (y >= kSide) << 1 | (z >= kSide) << 2;
  return {n.block[which], ((z % kSide) * kSide + y % kSide) * kSide + x % kSide};
}

struct Sample {
  float distance = 1;
  bool seen = false;
};

Sample sample_at(std::span<const VoxelBlock> blocks, const Voxel& v) {
  if (v.block == kNoBlock) return {};
  const VoxelBlock& b = blocks[v.block];
  return {b.distance[v.index], b.weight[v.index] > 0};
}

Neighbourhood neighbourhood(const VoxelVolume& volume, std::uint32_t block) {
  Neighbourhood n;
  for (int i = 0; i < 8; ++i) {
    const Vec3i c = volume.blocks()[block].coordinate + Vec3i{i & 1, i >> 1 & 1, i >> 2};
    n.block[i] = i == 0 ? block : volume.find(c).value_or(kNoBlock);
  }
  return n;
}

/// Whether the surface crosses between two seen voxels: one is inside, the other in front within
/// the band.
bool crosses(const Sample& a, const Sample& b) {
  return a.seen && b.seen && (a.distance < 0) != (b.distance < 0) && a.distance < 1 &&
         b.distance < 1;
}

BlockVertices place_vertices(const VoxelVolume& volume, std::uint32_t block,
                             const Neighbourhood& n) {
  const std::span blocks = volume.blocks();
  const double voxel_m = volume.config().voxel_m;
  const Vec3i origin = blocks[block].coordinate * kSide;
  BlockVertices out;
  out.index.fill(kNoVertex);
  for (int z = 0; z < kSide; ++z)
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) {
        const Voxel here = voxel_at(n, x, y, z);
        const Sample a = sample_at(blocks, here);
        if (!a.seen) continue;
        for (int axis = 0; axis < 3; ++axis) {
          const Sample b =
              sample_at(blocks, voxel_at(n, x + (axis == 0), y + (axis == 1), z + (axis == 2)));
          if (!crosses(a, b)) continue;
          Vec3d p = vec_cast<double>(origin + Vec3i{x, y, z});
          p[axis] += static_cast<double>(a.distance) / (a.distance - b.distance);
          out.index[here.index * 3 + axis] = static_cast<std::int16_t>(out.positions.size());
          out.positions.push_back(vec_cast<float>(p * voxel_m));
        }
      }
  return out;
}

/// Which corners of a cell are inside; 0 when the cell holds no surface.
int inside_corners(std::span<const VoxelBlock> blocks, const Neighbourhood& n, int x, int y,
                   int z) {
  int inside = 0;
  for (int c = 0; c < 8; ++c) {
    const Sample s = sample_at(blocks, voxel_at(n, x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)));
    if (!s.seen) return 0;
    inside |= (s.distance < 0) << c;
  }
  return inside;
}

/// Appends the cell's triangles; none when one of its crossings is a depth discontinuity.
void emit_cell(const std::vector<BlockVertices>& vertices, const Neighbourhood& n, int inside,
               int x, int y, int z, std::vector<Triangle>& out) {
  std::array<std::uint32_t, 12> vertex;
  for (int e = 0; e < 12; ++e) {
    const auto [low, axis] = kCellEdges[e];
    if ((inside >> low & 1) == (inside >> (low | 1 << axis) & 1)) continue;
    const Voxel v = voxel_at(n, x + (low & 1), y + (low >> 1 & 1), z + (low >> 2));
    const std::int16_t index = vertices[v.block].index[v.index * 3 + axis];
    if (index == kNoVertex) return;
    vertex[e] = vertices[v.block].first + static_cast<std::uint32_t>(index);
  }
  for (const auto& [a, b, c] : cell_triangles()[inside])
    out.push_back({vertex[a], vertex[b], vertex[c]});
}

}  // namespace

Mesh extract_surface(const VoxelVolume& volume) {
  const std::span blocks = volume.blocks();
  std::vector<Neighbourhood> around(blocks.size());
  std::vector<BlockVertices> vertices(blocks.size());
  parallel_for(blocks.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      around[b] = neighbourhood(volume, static_cast<std::uint32_t>(b));
      vertices[b] = place_vertices(volume, static_cast<std::uint32_t>(b), around[b]);
    }
  });

  Mesh mesh;
  for (BlockVertices& v : vertices) {
    v.first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), v.positions.begin(), v.positions.end());
  }

  std::vector<std::vector<Triangle>> triangles(blocks.size());
  parallel_for(blocks.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b)
      for (int z = 0; z < kSide; ++z)
        for (int y = 0; y < kSide; ++y)
          for (int x = 0; x < kSide; ++x) {
            const int inside = inside_corners(blocks, around[b], x, y, z);
            if (inside != 0 && inside != 255)
              emit_cell(vertices, around[b], inside, x, y, z, triangles[b]);
          }
  });
  for (const auto& t : triangles) mesh.triangles.insert(mesh.triangles.end(), t.begin(), t.end());
  return select_triangles(mesh, std::vector<std::uint8_t>(mesh.triangles.size(), 1));
}

}  // namespace mr::fusion
