#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/image.h"

namespace mr::still {

/// The connected parts of a mask; pixels touch beside, above and across corners.
struct Regions {
  ImageId label;                      ///< [H, W] 0: not in the mask; else its region's place in
                                      ///< `pixels`
  std::vector<std::uint32_t> pixels;  ///< [regions + 1] how many; [0] is 0
};
Regions connected_regions(const ImageMask& mask);

}  // namespace mr::still
