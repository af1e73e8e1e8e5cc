#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "mr/core/assert.h"

namespace mr {

/// A picture: rows from top to bottom, channels interleaved, no padding.
template <typename T, int kChannelCount>
struct Image {
  using Value = T;
  static constexpr int kChannels = kChannelCount;

  int width = 0, height = 0;
  std::vector<T> data;  ///< [height * width * channels]

  Image() = default;
  Image(int w, int h, T fill = T{})
      : width(w), height(h), data(static_cast<std::size_t>(w) * h * kChannels, fill) {}

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

}  // namespace mr
