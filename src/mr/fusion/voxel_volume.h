#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/vec.h"
#include "mr/fusion/block_directory.h"
#include "mr/fusion/frame_view.h"
#include "mr/fusion/row_collector.h"
#include "mr/fusion/voxel_block.h"

namespace mr::fusion {

/// Which frames a volume integrates.
enum class History {
  none,     ///< only the last frame, and only the voxels that its surface needs
  average,  ///< weighted average of all frames, from several sensors or a moving one
};

struct VolumeConfig {
  double voxel_m = 0.01;
  double truncation_m = 0.04;   ///< half width of the signed-distance band; at least voxel_m
                                ///< (a scene file must give 2 voxels, see FusionConfig)
  std::optional<Box3d> bounds;  ///< world; pixels whose points lie outside are dropped
  double chunk_m = 0;           ///< edge of the cubes that blocks are grouped by; 0: one group
  History history = History::average;
  std::size_t most_blocks = std::size_t{1} << 18;  ///< memory limit; surface beyond it is dropped
};

/// The blocks of one chunk: a range of VoxelVolume::order().
struct ChunkBlocks {
  Vec3i cube;  ///< coordinates in units of chunk_m
  std::size_t first = 0, count = 0;
};

/// Statistics of a frame's integration.
struct IntegrateReport {
  bool usable = true;              ///< false: camera or pose cannot be used, nothing was integrated
  std::size_t refused_pixels = 0;  ///< NaN, infinite, negative, below 1 µm or over 100 km
  std::size_t left_out_blocks = 0;  ///< blocks, or boxes of them, that exceeded a limit
  double allocate_ms = 0, integrate_ms = 0;
};

/// A truncated signed distance field (TSDF; Curless and Levoy 1996) in sparse blocks of 8³ voxels
/// that a hash map finds (voxel hashing, Nießner et al. 2013). World coordinates. Blocks are
/// allocated from the bounds of small tiles of pixels; only blocks (with History::none only rows of
/// voxels) that the surface may cross are computed. See docs/fusion.md.
class VoxelVolume {
 public:
  explicit VoxelVolume(const VolumeConfig& config);

  /// Fuses a frame. Parallel; the same bytes on any number of threads and with any SIMD target.
  IntegrateReport integrate(const DepthFrame& frame);

  /// Removes all blocks; keeps the memory.
  void clear();

  const VolumeConfig& config() const { return config_; }
  /// The slots of all blocks: chunk by chunk (by z, y, x of the cubes), inside a chunk by region of
  /// the directory and by position in it.
  std::span<const std::uint32_t> order() const { return order_; }
  std::span<const ChunkBlocks> chunks() const {
    return chunks_;
  }  ///< sorted by z, y, x; cover order()
  /// Number of slots in use: every slot is less than this.
  std::size_t slots() const { return slots_; }
  const VoxelBlock& block(std::uint32_t slot) const {
    return slabs_[slot / kSlab]->blocks[slot % kSlab];
  }
  const BlockDirectory& directory() const { return directory_; }
  /// The chunk that a block's centre lies in, as a cube of chunk_m.
  Vec3i chunk_of(Vec3i block) const;
  std::size_t memory_bytes() const;

 private:
  static constexpr std::uint32_t kSlab = 64;
  struct Slab {
    std::array<VoxelBlock, kSlab> blocks{};
  };
  using WeightSlab = std::array<VoxelBlock::Weights, kSlab>;

  VoxelBlock& block(std::uint32_t slot) { return slabs_[slot / kSlab]->blocks[slot % kSlab]; }
  VoxelBlock::Weights& weights(std::uint32_t slot) {
    return (*weights_[slot / kSlab])[slot % kSlab];
  }

  std::size_t allocate();
  std::vector<std::vector<WantedRows>> wanted_rows(std::size_t& left_out_ranges) const;
  std::uint32_t new_slot(Vec3i block);
  void sort_blocks();
  void update_blocks();

  VolumeConfig config_;
  BlockDirectory directory_;
  std::vector<std::unique_ptr<Slab>> slabs_;
  std::vector<std::unique_ptr<WeightSlab>> weights_;  ///< of slabs_; none with History::none
  std::size_t slots_ = 0;
  std::vector<std::uint32_t> order_;
  std::vector<ChunkBlocks> chunks_;
  std::vector<std::uint64_t>
      rows_;        ///< [slots] rows that the last frame's surface may cross, bit z·8 + y
  FrameView view_;  ///< of the last frame; kept for its memory
};

}  // namespace mr::fusion
