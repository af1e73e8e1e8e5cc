#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/image.h"

namespace mr::still {

/// Pixels of one row that touch each other: [first, end).
struct Run {
  int y, first, end;
  std::uint32_t region;  ///< place in ConnectedComponents::pixels
};

/// The connected parts of a mask; pixels touch beside, above and across corners.
struct ConnectedComponents {
  std::vector<Run> runs;              ///< row by row, from left to right
  std::vector<std::uint32_t> pixels;  ///< [regions] how many; numbered in the order of their runs

  /// Calls visit(place of the pixel in its picture, region) for each pixel.
  template <typename Visit>
  void for_each_pixel(int width, const Visit& visit) const {
    for (const Run& s : runs)
      for (int x = s.first; x < s.end; ++x)
        visit(static_cast<std::size_t>(s.y) * width + x, s.region);
  }
};
ConnectedComponents connected_components(const ImageMask& mask);

/// The first pixel from `x` on of a mask's row that is set; its end where none is.
int next_set(const std::uint8_t* row, int x, int end);

}  // namespace mr::still
