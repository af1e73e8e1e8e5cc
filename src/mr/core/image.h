#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <utility>
#include <vector>

#include "mr/core/assert.h"

namespace mr {

/// For vectors of numbers: resize() leaves what it adds as it lies in memory.
template <typename T>
struct UnfilledAllocator : std::allocator<T> {
  template <typename U>
  struct rebind {
    using other = UnfilledAllocator<U>;
  };
  template <typename U>
  void construct(U* at) {
    ::new (static_cast<void*>(at)) U;
  }
  template <typename U, typename... Args>
  void construct(U* at, Args&&... args) {
    std::construct_at(at, std::forward<Args>(args)...);
  }
};

/// A picture: rows from top to bottom, channels interleaved, no padding.
template <typename T, int kChannelCount>
struct Image {
  using Value = T;
  using Values = std::vector<T, UnfilledAllocator<T>>;
  static constexpr int kChannels = kChannelCount;

  int width = 0, height = 0;
  Values data;  ///< [height * width * channels]

  Image() = default;
  Image(int w, int h, T fill = T{})
      : width(w), height(h), data(static_cast<std::size_t>(w) * h * kChannels, fill) {}

  /// In one piece: a vector with an allocator of its own is copied number by number.
  Image(const Image& other) : width(other.width), height(other.height) {
    data.resize(other.data.size());
    std::copy(other.data.begin(), other.data.end(), data.begin());
  }
  Image(Image&&) noexcept = default;
  Image& operator=(const Image&) = default;
  Image& operator=(Image&&) noexcept = default;
  ~Image() = default;

  /// A picture whose pixels are yet to be written, all of them.
  static Image unfilled(int w, int h) {
    Image out;
    out.width = w, out.height = h;
    out.data.resize(static_cast<std::size_t>(w) * h * kChannels);
    return out;
  }

  bool empty() const { return data.empty(); }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }

  /// Pointer to the first channel of a pixel.
  T* at(int x, int y) { return data.data() + offset(x, y); }
  const T* at(int x, int y) const { return data.data() + offset(x, y); }
  T* row(int y) { return at(0, y); }
  const T* row(int y) const { return at(0, y); }

  friend bool operator==(const Image&, const Image&) = default;

 private:
  std::size_t offset(int x, int y) const {
    return (static_cast<std::size_t>(y) * width + x) * kChannels;
  }
};

using ImageRgb = Image<std::uint8_t, 3>;   ///< 8-bit sRGB, order R G B
using ImageDepth = Image<float, 1>;        ///< metres along the camera's z axis; 0 = invalid
using ImageMask = Image<std::uint8_t, 1>;  ///< 0 or 1
using ImageId = Image<std::uint32_t, 1>;   ///< index per pixel

/// A rectangle in pixels; `x`, `y` is its first pixel.
struct Rect {
  int x = 0, y = 0, width = 0, height = 0;

  bool empty() const { return width <= 0 || height <= 0; }
  friend bool operator==(const Rect&, const Rect&) = default;
};

/// Bilinear sample at (x, y), clamped to the pixel centres of `within` (not empty, inside the
/// picture).
inline std::array<std::uint8_t, 3> sample_bilinear(const ImageRgb& image, const Rect& within,
                                                   double x, double y) {
  x = std::clamp(x, static_cast<double>(within.x), within.x + within.width - 1.0);
  y = std::clamp(y, static_cast<double>(within.y), within.y + within.height - 1.0);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, within.x + within.width - 1);
  const int y1 = std::min(y0 + 1, within.y + within.height - 1);
  const double fx = x - x0, fy = y - y0;
  std::array<std::uint8_t, 3> out{};
  for (int c = 0; c < 3; ++c) {
    const double top = image.at(x0, y0)[c] * (1 - fx) + image.at(x1, y0)[c] * fx;
    const double bottom = image.at(x0, y1)[c] * (1 - fx) + image.at(x1, y1)[c] * fx;
    out[c] = static_cast<std::uint8_t>(top * (1 - fy) + bottom * fy + 0.5);
  }
  return out;
}

}  // namespace mr
