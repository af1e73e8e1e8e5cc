#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "mr/core/vec.h"
#include "mr/fusion/integrate_kernels.h"
#include "mr/fusion/voxel_block.h"

namespace mr::fusion {

/// A block (coordinates packed into one number) and the mask of its rows along x, bit z·8 + y, that
/// the surface may cross.
struct WantedRows {
  std::uint64_t key = 0;
  std::uint64_t rows = 0;

  static constexpr int kBits = 21;  ///< of a coordinate
  static constexpr std::int32_t kOrigin = 1 << (kBits - 1);
  static_assert(kFarthestBlock < kOrigin - 1);
  static std::uint64_t key_of(Vec3i block) {
    const auto bits = [](std::int32_t v) { return static_cast<std::uint64_t>(v + kOrigin); };
    return (bits(block.z) << kBits | bits(block.y)) << kBits | bits(block.x);
  }
  Vec3i block() const {
    const auto coordinate = [&](int place) {
      constexpr std::uint64_t kMask = (1 << kBits) - 1;
      return static_cast<std::int32_t>(key >> place * kBits & kMask) - kOrigin;
    };
    return {coordinate(0), coordinate(1), coordinate(2)};
  }
};

/// Collects the rows inside boxes of voxels, grouped by block. A small cache of recent blocks
/// merges most duplicates.
class RowCollector {
 public:
  /// `most`: limit of the number of blocks.
  explicit RowCollector(std::size_t most) : most_(most) { recent_.fill(0); }

  void add(const VoxelRange& r) {
    // Larger boxes come from pixels that see a distant surface at a grazing angle.
    constexpr std::int32_t kLargest = 32 * VoxelBlock::kSide;
    const Vec3i extent = r.high - r.low;
    if (blocks_.size() >= most_ || std::max({extent.x, extent.y, extent.z}) > kLargest) {
      ++left_out_;
      return;
    }
    constexpr int kLast = VoxelBlock::kSide - 1;
    constexpr std::uint64_t kEveryLayer = 0x0101010101010101u;
    const auto first = [](std::int32_t low, int block) { return std::max(low - block * 8, 0); };
    const auto after = [=](std::int32_t high, int block) {
      return kLast - std::min(high - block * 8, kLast);
    };
    const std::int32_t first_x = r.low.x >> 3, last_x = r.high.x >> 3;
    for (int z = r.low.z >> 3; z <= r.high.z >> 3; ++z) {
      const std::uint64_t layers =
          kEveryLayer << 8 * first(r.low.z, z) & kEveryLayer >> 8 * after(r.high.z, z);
      for (int y = r.low.y >> 3; y <= r.high.y >> 3; ++y) {
        const std::uint64_t rows =
            layers * (0xFFu << first(r.low.y, y) & 0xFFu >> after(r.high.y, y));
        const std::uint64_t key = WantedRows::key_of({first_x, y, z});
        for (std::int32_t x = 0; x <= last_x - first_x; ++x) add(key + x, rows);
      }
    }
  }

  std::size_t left_out() const { return left_out_; }  ///< ranges above a limit
  std::vector<WantedRows> take() { return std::move(blocks_); }

 private:
  void add(std::uint64_t key, std::uint64_t rows) {
    std::uint32_t& place = recent_[key * 0x9E3779B97F4A7C15u >> (64 - kRecentBits)];
    if (place < blocks_.size() && blocks_[place].key == key) {
      blocks_[place].rows |= rows;
    } else {
      place = static_cast<std::uint32_t>(blocks_.size());
      blocks_.push_back({key, rows});
    }
  }

  static constexpr int kRecentBits = 11;
  std::array<std::uint32_t, 1 << kRecentBits> recent_;
  std::vector<WantedRows> blocks_;
  std::size_t most_, left_out_ = 0;
};

}  // namespace mr::fusion
