#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "mr/core/image.h"

namespace mr::kit {

/// The planes of a YCbCr 4:2:0 picture, BT.709, limited range. Chroma samples lie in the centre of
/// their four pixels.
template <typename Byte>
struct YuvPlanes {
  std::array<Byte*, 3> data;             ///< Y [H, W], Cb and Cr [⌈H / 2⌉, ⌈W / 2⌉]
  std::array<std::ptrdiff_t, 3> stride;  ///< bytes from row to row
};

/// Converts RGB to YCbCr of the same, even size. Chroma is the mean of four pixels. Parallel; the
/// same bytes with every instruction set.
void rgb_to_yuv(const ImageRgb& rgb, const YuvPlanes<std::uint8_t>& out);

/// Converts YCbCr to RGB; `out` must have the size already. Chroma is interpolated bilinearly.
/// Parallel; the same bytes with every instruction set.
void yuv_to_rgb(const YuvPlanes<const std::uint8_t>& yuv, ImageRgb& out);

}  // namespace mr::kit
