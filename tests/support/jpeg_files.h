#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mr/core/image.h"

/// JPEGs of kinds that kit::encode_jpeg() does not write.
namespace mr::test {

enum class JpegChroma { full, half_width, half_height, quarter, none };  // 4:4:4 4:2:2 4:4:0 4:2:0

struct JpegKind {
  int quality = 90;
  JpegChroma chroma = JpegChroma::quarter;
  bool progressive = false;
};

std::vector<std::byte> jpeg_file(const ImageRgb& image, const JpegKind& kind);

/// A grey picture of four inks.
std::vector<std::byte> cmyk_jpeg_file(int width, int height);

/// Where the frame header's marker (FF C0 or FF C2) lies.
std::size_t jpeg_frame_header_at(std::span<const std::byte> jpeg);

}  // namespace mr::test
