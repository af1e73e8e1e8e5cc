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

/// Copies rows [begin, end) of a frame into a view; what is no usable depth, or lies outside the
/// view's bounds, becomes kNothing. Returns how many pixels held a number that can be no depth.
std::size_t copy_rows(const DepthFrame& frame, int begin, int end, FrameView& view);

/// A box of voxels, both ends included, from the first voxel of a view's eye_block.
struct VoxelRange {
  Vec3i low, high;
};

/// The voxels inside a box of blocks from eye_block, and a margin around it. What lies more than
/// kFarthestBlock away is cut off.
inline constexpr std::int32_t kFarthestBlock = 1'000'000;
inline VoxelRange voxels_within(Vec3f low, Vec3f high, float margin) {
  const auto voxel = [](float blocks) {
    constexpr float kFarthest = kFarthestBlock;
    return static_cast<std::int32_t>(
        std::floor(std::clamp(blocks, -kFarthest, kFarthest) * VoxelBlock::kSide));
  };
  return {{voxel(low.x - margin) + 1, voxel(low.y - margin) + 1, voxel(low.z - margin) + 1},
          {voxel(high.x + margin), voxel(high.y + margin), voxel(high.z + margin)}};
}

/// Pixels are looked at in squares of so many.
inline constexpr int kTile = 4;

/// How a tile's pixels become ranges of voxels.
struct TileRule {
  float margin;   ///< around the surface, blocks; half a pixel comes on top
  float largest;  ///< blocks; a tile that extends farther, and is steep, is taken apart
  float band_m;   ///< how far behind an edge something may hang
};

/// Appends the boxes that hold the surface seen by row `tile_row` of tiles.
void tile_ranges(const FrameView& view, int tile_row, const TileRule& rule,
                 std::vector<VoxelRange>& out);

/// Writes a frame into a block, and only into those of its rows along x whose bit z·8 + y is set;
/// whatever the block held is lost.
void integrate_first(const FrameView& view, std::uint64_t rows, VoxelBlock& block);

/// Averages a frame into all of a block; weights start with 0 (Curless & Levoy 1996).
void integrate_next(const FrameView& view, VoxelBlock& block, VoxelBlock::Weights& weights);

}  // namespace mr::fusion
