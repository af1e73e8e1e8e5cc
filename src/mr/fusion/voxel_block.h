#pragma once

#include <array>
#include <cstdint>

#include "mr/core/vec.h"

namespace mr::fusion {

/// 8³ voxels. Voxel (x, y, z) has index (z·8 + y)·8 + x, is bit y·8 + x of layer z, and lies at
/// (block·8 + (x, y, z)) · voxel_m.
struct alignas(64) VoxelBlock {
  static constexpr int kSide = 8;
  static constexpr int kVoxels = kSide * kSide * kSide;
  static constexpr int kTruncated = 32767;              ///< the stored distance of ± truncation
  static constexpr int kWeightUnit = 16;                ///< weight of one observation from 1 m away
  using Bits = std::array<std::uint64_t, kSide>;        ///< one bit per voxel, in layers
  using Distances = std::array<std::int16_t, kVoxels>;  ///< in truncation / kTruncated
  using Weights = std::array<std::uint16_t, kVoxels>;   ///< in 1 / kWeightUnit; 0: never seen

  /// Signed distance to the surface, positive in front; never 0, so that no vertex falls on a
  /// voxel. Undefined where `seen` is not set.
  Distances distance;
  /// Bit masks for marching cubes: observed; observed and behind a surface (distance below 0);
  /// observed and within the band (distance below kTruncated).
  Bits seen, inside, near;
  Vec3i coordinate;  ///< in blocks
};

}  // namespace mr::fusion
