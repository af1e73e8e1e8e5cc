#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "mr/kit/float4.h"

namespace mr::kit {

/// Mask by which inverse depths are compared: without the last 6 bits, which are a thirty-millionth
/// of a metre at 3 m, so that rounding does not decide which of two equal surfaces is nearer.
inline constexpr std::uint32_t kInverseDepthBits = ~63u;
inline float comparable(float inverse_depth) {
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(inverse_depth) & kInverseDepthBits);
}

/// A fragment: a triangle in one pixel. `entry`: the triangle's index in the tile's list.
struct Fragment {
  std::uint32_t not_entry;
  float inv_z;  ///< 1 / depth, comparable()

  std::uint32_t entry() const { return ~not_entry; }
  /// Sort key: larger is nearer; at equal depths the first triangle's is larger.
  std::uint64_t key() const { return std::bit_cast<std::uint64_t>(*this); }
  static Fragment of_key(std::uint64_t key) { return std::bit_cast<Fragment>(key); }
};
static_assert(std::endian::native == std::endian::little, "for the order of Fragment::key()");

/// Size of a tile, so that its A-buffer fits into the L2 cache.
inline constexpr int kTileColumnBits = 7, kTileRowBits = 5;
inline constexpr int kTileColumns = 1 << kTileColumnBits, kTileRows = 1 << kTileRowBits;

/// The A-buffer of a tile (Carpenter 1984; a layered depth image): for each pixel the list of all
/// its fragments, hidden ones included. There is room for four fragments per pixel, and one
/// overflow list per tile.
class ABuffer {
 public:
  static constexpr int kPlaces = 4;
  static constexpr int kStride = kTileColumns + 4;  ///< groups of four may begin anywhere

  ABuffer() : counts_(kStride * kTileRows), fragments_(counts_.size() * kPlaces) {}

  void clear() {
    std::fill(counts_.begin(), counts_.end(), std::uint8_t{0});
    overflow_.clear();
  }

  /// Adds a triangle's fragments in those of the four pixels from `pixel` (row · kStride + column)
  /// on whose `bits` are set.
  void add(std::size_t pixel, unsigned bits, Float4 inv_z, std::uint32_t entry) {
    std::uint32_t counts;
    std::memcpy(&counts, &counts_[pixel], 4);
    if ((counts & 0x04040404u) != 0) return add_one_by_one(pixel, bits, inv_z, entry);
    // All four are written; those that are not counted will be overwritten.
    const Int4 z = as_ints(inv_z), e = splat4(static_cast<std::int32_t>(~entry));
    const Int4 low = __builtin_shufflevector(e, z, 0, 4, 1, 5);
    const Int4 high = __builtin_shufflevector(e, z, 2, 6, 3, 7);
    Fragment* place = &fragments_[pixel * kPlaces];
    std::memcpy(place + (counts & 3), &low, 8);
    std::memcpy(place + kPlaces + (counts >> 8 & 3), reinterpret_cast<const char*>(&low) + 8, 8);
    std::memcpy(place + 2 * kPlaces + (counts >> 16 & 3), &high, 8);
    std::memcpy(place + 3 * kPlaces + (counts >> 24), reinterpret_cast<const char*>(&high) + 8, 8);
    counts += (bits * 0x00204081u) & 0x01010101u;  // bit i to byte i
    std::memcpy(&counts_[pixel], &counts, 4);
  }

  /// Calls work(column, row, std::span<const Fragment>) for every pixel that has at least `least`
  /// fragments, row by row; the fragments are in the order of drawing.
  template <typename PixelWork>
  void for_each_pixel(int columns, int rows, unsigned least, PixelWork&& work) {
    const auto by_pixel = [](const Overflow& a, const Overflow& b) { return a.pixel < b.pixel; };
    std::stable_sort(overflow_.begin(), overflow_.end(), by_pixel);
    std::size_t next = 0;
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < columns; ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * kStride + x;
        const unsigned count = counts_[pixel];
        if (count < least) continue;
        const Fragment* first = &fragments_[pixel * kPlaces];
        if (count <= kPlaces) {
          work(x, y, std::span(first, count));
          continue;
        }
        many_.assign(first, first + kPlaces);
        for (; next < overflow_.size() && overflow_[next].pixel <= pixel; ++next)
          if (overflow_[next].pixel == pixel) many_.push_back(overflow_[next].fragment);
        work(x, y, std::span<const Fragment>(many_));
      }
  }

 private:
  struct Overflow {
    std::uint32_t pixel;
    Fragment fragment;
  };

  void add_one_by_one(std::size_t pixel, unsigned bits, Float4 inv_z, std::uint32_t entry) {
    for (int i = 0; i < 4; ++i) {
      if ((bits >> i & 1) == 0) continue;
      std::uint8_t& count = counts_[pixel + i];
      if (count < kPlaces)
        fragments_[(pixel + i) * kPlaces + count] = {~entry, inv_z[i]};
      else
        overflow_.push_back({static_cast<std::uint32_t>(pixel + i), {~entry, inv_z[i]}});
      count = static_cast<std::uint8_t>(std::min(count + 1, kPlaces + 1));
    }
  }

  std::vector<std::uint8_t> counts_;  ///< [pixels] kPlaces + 1: more than that
  std::vector<Fragment> fragments_;
  std::vector<Overflow> overflow_;
  std::vector<Fragment> many_;
};

}  // namespace mr::kit
