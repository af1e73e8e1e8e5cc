#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/image.h"

namespace mr::still {

/// A run: consecutive pixels of one row, [first, end).
struct Run {
  int y, first, end;
  std::uint32_t region;  ///< index into ConnectedComponents::pixels
};

/// The 8-connected components of a mask, as runs (run-based labelling with union-find).
struct ConnectedComponents {
  std::vector<Run> runs;              ///< row by row, from left to right
  std::vector<std::uint32_t> pixels;  ///< [regions] sizes, in the order of the regions' first runs

  /// Calls visit(index of the pixel in its picture, region) for each pixel.
  template <typename Visit>
  void for_each_pixel(int width, const Visit& visit) const {
    for (const Run& s : runs)
      for (int x = s.first; x < s.end; ++x)
        visit(static_cast<std::size_t>(s.y) * width + x, s.region);
  }
};
ConnectedComponents connected_components(const ImageMask& mask);

/// The first set pixel of a mask's row from `x` on; `end` if there is none.
int next_set(const std::uint8_t* row, int x, int end);

}  // namespace mr::still
