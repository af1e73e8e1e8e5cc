#pragma once

#include <cstddef>
#include <span>

#include "mr/core/image.h"
#include "mr/core/result.h"

namespace mr::kit {

/// Layouts of uncoded colour pictures, as cameras and recordings name them.
enum class RawColorFormat {
  nv12,  ///< rows of Y, then half as many rows of Cb Cr pairs, each for 2x2 pixels
  yuy2,  ///< Y0 Cb Y1 Cr for two pixels of a row
  bgra,  ///< blue, green, red and an ignored byte
  uyvy,  ///< Cb Y0 Cr Y1 for two pixels of a row
  rgb,   ///< red, green, blue
  bgr,   ///< blue, green, red
  rgba,  ///< red, green, blue and an ignored byte
};

/// A picture of `width` x `height` pixels; Y Cb Cr has even sides (yuy2, uyvy: an even width).
struct RawColorLayout {
  RawColorFormat format = RawColorFormat::nv12;
  int width = 0, height = 0;
  int stride_bytes = 0;  ///< from row to row; 0: rows without gaps
};

/// Bytes from row to row where there are no gaps: 1 to 4 times the width.
int tight_stride_bytes(const RawColorLayout& layout);

/// Converts to RGB. Y Cb Cr is BT.601, limited range (Y 16..235, Cb and Cr 16..240), a chroma
/// sample holds for all of its pixels: what the Azure Kinect SDK does with NV12 and YUY2 (libyuv's
/// NV12ToARGB and YUY2ToARGB) but for rounding, of at most 2 levels. Results are rounded to the
/// nearest level. Errors: invalid (size or stride), corrupt (another number of bytes than the
/// layout has), too_large. Parallel.
Result<ImageRgb> decode_raw_color(std::span<const std::byte> bytes, const RawColorLayout& layout);

}  // namespace mr::kit
