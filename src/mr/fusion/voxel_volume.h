#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/pose.h"
#include "mr/core/vec.h"

namespace mr::fusion {

struct VolumeConfig {
  double voxel_m = 0.01;
  double truncation_m = 0.04;   ///< half width of the signed-distance band
  std::optional<Box3d> bounds;  ///< world; surface outside is dropped before fusion
};

/// 8³ voxels. Voxel (x, y, z) has index (z·8 + y)·8 + x, is bit y·8 + x of layer z, and lies at
/// (block·8 + (x, y, z)) · voxel_m.
struct VoxelBlock {
  static constexpr int kSide = 8;
  static constexpr int kVoxels = kSide * kSide * kSide;
  using Bits = std::array<std::uint64_t, kSide>;  ///< one bit per voxel, in layers

  Vec3i coordinate;                       ///< in blocks
  std::array<float, kVoxels> distance{};  ///< signed distance / truncation, in [-1, 1]; 1 = free
  std::array<float, kVoxels> weight{};    ///< 0: never seen, and `distance` means nothing
  /// What the surface is found by: seen at all, seen behind a surface (distance
  /// below 0), seen within the band (distance below 1).
  Bits seen{}, inside{}, near{};
};

/// A truncated signed distance field (Curless & Levoy 1996) in sparse blocks behind a hashed
/// directory (Nießner et al. 2013). Several frames can be fused into one volume. World coordinates.
class VoxelVolume {
 public:
  explicit VoxelVolume(const VolumeConfig& config);

  /// Fuses the depth pixels inside `region` (all others count as unseen). The camera is an
  /// undistorted pinhole. Parallel over rows and blocks.
  void integrate(const ImageDepth& depth, const Camera& camera, const Pose& T_world_camera,
                 const Rect& region);

  const VolumeConfig& config() const { return config_; }
  /// Sorted by z, y, x after each integrate().
  std::span<const VoxelBlock> blocks() const { return blocks_; }
  /// Place in blocks(), or nothing.
  std::optional<std::uint32_t> find(Vec3i block_coordinate) const;
  std::size_t memory_bytes() const;

 private:
  void add_blocks(const std::vector<Vec3i>& sorted_coordinates);
  void rebuild_directory();

  VolumeConfig config_;
  std::vector<VoxelBlock> blocks_;
  std::vector<std::uint32_t> directory_;  ///< open addressing; kEmptySlot or a place in blocks_
};

}  // namespace mr::fusion
