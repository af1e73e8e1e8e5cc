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

/// A block and those of its rows along x, bit z·8 + y, in which surface may be found.
struct WantedRows {
  Vec3i block;
  std::uint64_t rows = 0;
};

/// Collects the rows inside boxes of voxels by block. Blocks met lately are not listed again, so
/// most come once.
class RowCollector {
 public:
  RowCollector() { recent_.fill(0); }

  void add(const VoxelRange& r) {
    constexpr int kLast = VoxelBlock::kSide - 1;
    constexpr std::uint64_t kEveryLayer = 0x0101010101010101u;
    const auto first = [](std::int32_t low, int block) { return std::max(low - block * 8, 0); };
    const auto after = [=](std::int32_t high, int block) {
      return kLast - std::min(high - block * 8, kLast);
    };
    for (int z = r.low.z >> 3; z <= r.high.z >> 3; ++z) {
      const std::uint64_t layers =
          kEveryLayer << 8 * first(r.low.z, z) & kEveryLayer >> 8 * after(r.high.z, z);
      for (int y = r.low.y >> 3; y <= r.high.y >> 3; ++y) {
        const std::uint64_t rows =
            layers * (0xFFu << first(r.low.y, y) & 0xFFu >> after(r.high.y, y));
        for (int x = r.low.x >> 3; x <= r.high.x >> 3; ++x) add({x, y, z}, rows);
      }
    }
  }

  std::vector<WantedRows> take() { return std::move(blocks_); }

 private:
  void add(Vec3i block, std::uint64_t rows) {
    const std::uint32_t mixed = static_cast<std::uint32_t>(block.x) +
                                static_cast<std::uint32_t>(block.y) * 61u +
                                static_cast<std::uint32_t>(block.z) * 3571u;
    std::uint32_t& place = recent_[mixed % recent_.size()];
    if (place < blocks_.size() && blocks_[place].block == block) {
      blocks_[place].rows |= rows;
    } else {
      place = static_cast<std::uint32_t>(blocks_.size());
      blocks_.push_back({block, rows});
    }
  }

  std::array<std::uint32_t, 1024> recent_;
  std::vector<WantedRows> blocks_;
};

}  // namespace mr::fusion
