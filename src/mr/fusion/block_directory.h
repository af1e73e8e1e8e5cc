#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "mr/core/vec.h"

namespace mr::fusion {

/// A hash map from block coordinates to the slots in which a volume stores its blocks (voxel
/// hashing, Nießner et al. 2013), in two levels: 8³ blocks make a region, an open-addressing hash
/// table finds the region, and an array inside it the slot. Only regions that hold a block exist.
class BlockDirectory {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;  ///< no block there
  static constexpr int kRegionBits = 3, kRegionSide = 1 << kRegionBits;

  struct Region {
    Vec3i coordinate;  ///< in regions
    std::array<std::uint32_t, kRegionSide * kRegionSide * kRegionSide> slots;
  };

  BlockDirectory() { clear(); }

  /// Removes everything; keeps the allocated memory.
  void clear();
  /// The slot of a block, or kNone.
  std::uint32_t find(Vec3i block) const {
    const Region* region = find_region(region_of(block));
    return region ? region->slots[place_in_region(block)] : kNone;
  }
  /// Reference to a block's slot; its region is created if missing. Valid until the next call.
  std::uint32_t& at(Vec3i block) {
    return need_region(region_of(block)).slots[place_in_region(block)];
  }
  const Region* find_region(Vec3i region) const;

  std::span<Region> regions() { return {regions_.data(), count_}; }
  std::span<const Region> regions() const { return {regions_.data(), count_}; }
  std::size_t memory_bytes() const {
    return regions_.capacity() * sizeof(Region) + table_.capacity() * sizeof(std::uint32_t);
  }

  static Vec3i region_of(Vec3i block) {
    return {block.x >> kRegionBits, block.y >> kRegionBits, block.z >> kRegionBits};
  }
  static int place_in_region(Vec3i block) {
    constexpr int kMask = kRegionSide - 1;
    return ((block.z & kMask) * kRegionSide + (block.y & kMask)) * kRegionSide + (block.x & kMask);
  }
  static Vec3i block_at(Vec3i region, int place) {
    return region * kRegionSide + Vec3i{place % kRegionSide, place / kRegionSide % kRegionSide,
                                        place / (kRegionSide * kRegionSide)};
  }

 private:
  Region& need_region(Vec3i region);
  void rehash(std::size_t size);

  std::vector<Region> regions_;  ///< the first count_ are in use
  std::size_t count_ = 0;
  std::vector<std::uint32_t> table_;  ///< hash table, open addressing: index into regions_ or kNone
  std::size_t last_ = 0;              ///< the region found last, which is tried first
};

}  // namespace mr::fusion
