#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mr/fusion/frame_view.h"
#include "mr/fusion/voxel_block.h"

/// The inner loops of allocation and integration, compiled for several instruction sets and chosen
/// at run time (Highway; core/simd.h). All arithmetic is in single IEEE operations, without fused
/// multiply-add and approximations: every set gives the same bytes.
namespace mr::fusion {

/// Copies rows [begin, end) of a frame into a view; invalid depth, and points outside the view's
/// bounds, become kNothing. Returns the number of pixels with an impossible value.
std::size_t copy_rows(const DepthFrame& frame, int begin, int end, FrameView& view);

/// A box of voxels, both ends included, from the first voxel of a view's eye_block.
struct VoxelRange {
  Vec3i low, high;
};

/// The voxels inside a box, given in blocks from eye_block, and a margin around it; clipped at
/// kFarthestBlock.
inline constexpr std::int32_t kFarthestBlock = 1'000'000;
inline VoxelRange voxels_within(Vec3f low, Vec3f high, float margin) {
  const auto voxel = [](float blocks) {
    constexpr float kFarthest = kFarthestBlock;
    const float voxels = std::clamp(blocks, -kFarthest, kFarthest) * VoxelBlock::kSide;
    const auto whole = static_cast<std::int32_t>(voxels);  // std::floor may be a call
    return whole - static_cast<std::int32_t>(static_cast<float>(whole) > voxels);
  };
  return {{voxel(low.x - margin) + 1, voxel(low.y - margin) + 1, voxel(low.z - margin) + 1},
          {voxel(high.x + margin), voxel(high.y + margin), voxel(high.z + margin)}};
}

/// Edge of a tile, pixels: the unit of block allocation.
inline constexpr int kTile = 4;

/// Parameters of the conversion from a tile's pixels to ranges of voxels to allocate.
struct TileRule {
  float margin;   ///< around the surface, blocks; half a pixel is added
  float largest;  ///< blocks; a steep tile that extends farther is split into pixels
  float band_m;   ///< range behind a depth edge in which mixed pixels may lie
};

/// Appends boxes of voxels that contain the surface seen by row `tile_row` of tiles.
void tile_ranges(const FrameView& view, int tile_row, const TileRule& rule,
                 std::vector<VoxelRange>& out);

/// Overwrites a block with a frame's signed distances, only in rows along x whose bit z·8 + y is
/// set.
void integrate_first(const FrameView& view, std::uint64_t rows, VoxelBlock& block);

/// Integrates a frame into a whole block by weighted averaging (Curless and Levoy 1996). Weights
/// must be 0 in a new block.
void integrate_next(const FrameView& view, VoxelBlock& block, VoxelBlock::Weights& weights);

}  // namespace mr::fusion
