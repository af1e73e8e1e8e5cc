#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "mr/core/image.h"

namespace mr::kit {

/// Luma and both chromas of a picture in BT.709, limited range, 4:2:0; a chroma sample lies in the
/// middle of the four pixels that it is of.
template <typename Byte>
struct YuvPlanes {
  std::array<Byte*, 3> data;             ///< Y [H, W], Cb and Cr [⌈H / 2⌉, ⌈W / 2⌉]
  std::array<std::ptrdiff_t, 3> stride;  ///< bytes from row to row
};

/// To a picture of the same size, which is even. Chroma is the mean of four pixels. Parallel; the
/// same bytes with every instruction set.
void rgb_to_yuv(const ImageRgb& rgb, const YuvPlanes<std::uint8_t>& out);

/// To a picture that has its size already. Chroma is interpolated. Parallel; the same bytes with
/// every instruction set.
void yuv_to_rgb(const YuvPlanes<const std::uint8_t>& yuv, ImageRgb& out);

}  // namespace mr::kit
