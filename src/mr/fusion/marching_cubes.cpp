#include "mr/fusion/marching_cubes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/fusion/marching_cubes_table.h"

namespace mr::fusion {
namespace {

constexpr int kSide = VoxelBlock::kSide;
constexpr std::size_t kBlocksAtOnce = 64;
using Bits = VoxelBlock::Bits;

const VoxelBlock kUnseen{};

/// How many bits are set in a byte.
constexpr std::array<std::uint8_t, 256> kBitCount = [] {
  std::array<std::uint8_t, 256> count{};
  for (int i = 1; i < 256; ++i) count[i] = static_cast<std::uint8_t>(count[i / 2] + i % 2);
  return count;
}();

/// Surface vertices on the edges that start at a block's voxels. The vertex on the edge along
/// `axis` from voxel (x, y, z) has the number first[axis][z·8 + y] + the crossings before it in its
/// row.
struct BlockVertices {
  std::array<Bits, 3> crossing{};  ///< [axis]
  std::array<std::array<std::uint32_t, kSide * kSide>, 3> first;
  std::uint32_t count = 0;

  std::uint32_t vertex(int axis, int x, int y, int z) const {
    const std::uint64_t before = (std::uint64_t{1} << x) - 1;
    return first[axis][z * kSide + y] + kBitCount[crossing[axis][z] >> 8 * y & before];
  }
};

/// A block (0) and its seven neighbours towards larger coordinates: bit `axis` of a place tells
/// whether it is the next one along that axis.
template <typename Block>
using Around = std::array<const Block*, 8>;

std::array<std::uint32_t, 8> neighbours(const VoxelVolume& volume, std::uint32_t block) {
  const auto missing = static_cast<std::uint32_t>(volume.blocks().size());
  std::array<std::uint32_t, 8> out{block};
  for (int i = 1; i < 8; ++i)
    out[i] = volume.find(volume.blocks()[block].coordinate + Vec3i{i & 1, i >> 1 & 1, i >> 2})
                 .value_or(missing);
  return out;
}

template <typename Block>
Around<Block> around(std::span<const Block> all, const std::array<std::uint32_t, 8>& places,
                     const Block& missing) {
  Around<Block> out;
  for (int i = 0; i < 8; ++i) out[i] = places[i] < all.size() ? &all[places[i]] : &missing;
  return out;
}

/// For all 64 voxels of layer z at once: the bit of the voxel at offset `corner` (bit `axis`: one
/// further along that axis).
std::uint64_t corner_bits(const Around<VoxelBlock>& a, Bits VoxelBlock::*bits, int z, int corner) {
  const int up = (corner & 4) != 0 && z + 1 == kSide ? 4 : 0, layer = (z + (corner >> 2)) % kSide;
  const auto of = [&](int place) { return (a[place | up]->*bits)[layer]; };
  constexpr std::uint64_t kLastColumn = 0x8080808080808080u;
  const auto along_x = [&](int place) {
    return (of(place) >> 1 & ~kLastColumn) | (of(place | 1) << 7 & kLastColumn);
  };
  const auto row_of = [&](int place) { return corner & 1 ? along_x(place) : of(place); };
  return corner & 2 ? row_of(0) >> kSide | row_of(2) << (64 - kSide) : row_of(0);
}

/// Finds the edges at which one end is inside and the other in front, both within the band.
void mark_crossings(const Around<VoxelBlock>& a, BlockVertices& out) {
  for (int z = 0; z < kSide; ++z)
    for (int axis = 0; axis < 3; ++axis) {
      const std::uint64_t near = a[0]->near[z] & corner_bits(a, &VoxelBlock::near, z, 1 << axis);
      const std::uint64_t crossing =
          near & (a[0]->inside[z] ^ corner_bits(a, &VoxelBlock::inside, z, 1 << axis));
      out.crossing[axis][z] = crossing;
      for (std::uint64_t rest = crossing; rest != 0; rest >>= 8)
        out.count += kBitCount[rest & 0xFF];
    }
}

/// Numbers a block's vertices from `number` on and writes their positions.
void place_vertices(const Around<VoxelBlock>& a, double voxel_m, std::uint32_t number,
                    BlockVertices& vertices, std::vector<Vec3f>& positions) {
  const VoxelBlock& block = *a[0];
  for (int axis = 0; axis < 3; ++axis)
    for (int z = 0; z < kSide; ++z) {
      int last_row = -1;
      for (std::uint64_t rest = vertices.crossing[axis][z]; rest != 0; rest &= rest - 1) {
        const int bit = std::countr_zero(rest), row = z * kSide + bit / kSide;
        if (row != last_row) vertices.first[axis][row] = number;
        last_row = row;
        const Vec3i here{bit % kSide, bit / kSide, z};
        Vec3i next = here;
        ++next[axis];
        const VoxelBlock& other = *a[next[axis] == kSide ? 1 << axis : 0];
        next[axis] %= kSide;
        const float d_here = block.distance[z * 64 + bit],
                    d_next = other.distance[(next.z * kSide + next.y) * kSide + next.x];
        Vec3d place = vec_cast<double>(block.coordinate * kSide + here);
        place[axis] += static_cast<double>(d_here) / (d_here - d_next);
        positions[number++] = vec_cast<float>(place * voxel_m);
      }
    }
}

/// [inside corners] corners outside that share an edge of the cell with one inside.
const std::array<std::uint8_t, 256> kOutsideNextToInside = [] {
  std::array<std::uint8_t, 256> out{};
  for (int inside = 0; inside < 256; ++inside)
    for (const auto& [low, axis] : kCellEdges) {
      const int ends = 1 << low | 1 << (low | 1 << axis);
      if ((inside & ends) != 0 && (inside & ends) != ends)
        out[inside] = static_cast<std::uint8_t>(out[inside] | (ends & ~inside));
    }
  return out;
}();

/// Appends the triangles of the cell at voxel (x, y, z).
void emit_cell(const Around<BlockVertices>& vertices, int inside, int x, int y, int z,
               std::vector<Triangle>& out) {
  const auto vertex = [&](int e) {
    const auto [low, axis] = kCellEdges[e];
    const int vx = x + (low & 1), vy = y + (low >> 1 & 1), vz = z + (low >> 2);
    const int place = vx / kSide | vy / kSide << 1 | vz / kSide << 2;
    return vertices[place]->vertex(axis, vx % kSide, vy % kSide, vz % kSide);
  };
  for (const auto& [a, b, c] : cell_triangles()[inside])
    out.push_back({vertex(a), vertex(b), vertex(c)});
}

/// Appends the triangles of the cells at a layer's voxels. Cells with a corner never seen have
/// none, nor have those in which the inside meets free space beyond the band.
void emit_layer(const Around<VoxelBlock>& blocks, const Around<BlockVertices>& vertices, int z,
                std::vector<Triangle>& out) {
  std::array<std::uint64_t, 8> inside, near;
  std::uint64_t any = 0, all = ~std::uint64_t{0}, seen = all;
  for (int corner = 0; corner < 8; ++corner) {
    inside[corner] = corner_bits(blocks, &VoxelBlock::inside, z, corner);
    any |= inside[corner], all &= inside[corner];
  }
  if ((any & ~all) == 0) return;
  for (int corner = 0; corner < 8; ++corner) {
    near[corner] = corner_bits(blocks, &VoxelBlock::near, z, corner);
    seen &= corner_bits(blocks, &VoxelBlock::seen, z, corner);
  }
  for (std::uint64_t cells = any & ~all & seen; cells != 0; cells &= cells - 1) {
    const int bit = std::countr_zero(cells);
    unsigned in = 0, in_band = 0;
    for (int corner = 0; corner < 8; ++corner) {
      in |= (inside[corner] >> bit & 1u) << corner;
      in_band |= (near[corner] >> bit & 1u) << corner;
    }
    if ((kOutsideNextToInside[in] & ~in_band) == 0)
      emit_cell(vertices, static_cast<int>(in), bit % kSide, bit / kSide, z, out);
  }
}

/// Numbers vertices in the order in which triangles use them; others are dropped.
Mesh in_order_of_use(const std::vector<Vec3f>& positions,
                     const std::vector<std::vector<Triangle>>& triangles) {
  constexpr std::uint32_t kUnused = 0xFFFFFFFFu;
  std::vector<std::uint32_t> new_index(positions.size(), kUnused);
  Mesh mesh;
  std::size_t count = 0;
  for (const auto& group : triangles) count += group.size();
  mesh.triangles.reserve(count);
  mesh.positions.reserve(positions.size());
  for (const auto& group : triangles)
    for (Triangle t : group) {
      for (std::uint32_t& v : t) {
        if (new_index[v] == kUnused) {
          new_index[v] = static_cast<std::uint32_t>(mesh.positions.size());
          mesh.positions.push_back(positions[v]);
        }
        v = new_index[v];
      }
      mesh.triangles.push_back(t);
    }
  return mesh;
}

}  // namespace

Mesh extract_surface(const VoxelVolume& volume) {
  const std::span<const VoxelBlock> blocks = volume.blocks();
  const auto for_blocks = [&](const auto& work) {
    parallel_for(blocks.size(), kBlocksAtOnce, [&](std::size_t begin, std::size_t end) {
      for (std::size_t b = begin; b < end; ++b) work(b);
    });
  };
  std::vector<std::array<std::uint32_t, 8>> places(blocks.size());
  std::vector<BlockVertices> vertices(blocks.size());
  for_blocks([&](std::size_t b) {
    places[b] = neighbours(volume, static_cast<std::uint32_t>(b));
    mark_crossings(around(blocks, places[b], kUnseen), vertices[b]);
  });

  std::vector<std::uint32_t> first(blocks.size() + 1, 0);
  for (std::size_t b = 0; b < blocks.size(); ++b) first[b + 1] = first[b] + vertices[b].count;
  std::vector<Vec3f> positions(first.back());
  for_blocks([&](std::size_t b) {
    place_vertices(around(blocks, places[b], kUnseen), volume.config().voxel_m, first[b],
                   vertices[b], positions);
  });

  const BlockVertices none{};
  std::vector<std::vector<Triangle>> triangles((blocks.size() + kBlocksAtOnce - 1) / kBlocksAtOnce);
  parallel_for(triangles.size(), 1, [&](std::size_t begin, std::size_t end) {
    const std::size_t last = std::min(end * kBlocksAtOnce, blocks.size());
    for (std::size_t b = begin * kBlocksAtOnce; b < last; ++b)
      for (int z = 0; z < kSide; ++z)
        emit_layer(around(blocks, places[b], kUnseen),
                   around<BlockVertices>(vertices, places[b], none), z,
                   triangles[b / kBlocksAtOnce]);
  });
  return in_order_of_use(positions, triangles);
}

}  // namespace mr::fusion
