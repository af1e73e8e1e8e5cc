#pragma once

#include <cstdint>

#include "mr/core/image.h"

namespace mr::still {

/// How much a pixel speaks for something that moves.
enum class Motion : std::uint8_t {
  none = 0,
  weak = 1,     ///< counts beside stronger ones: feet on the floor, hands on a table
  strong = 2,   ///< clearly nearer than what stays, or nothing is known to stay there
  no_depth = 3  ///< was known and fails now: hair, dark clothes
};

/// The regions that move (DESIGN section 9): strong pixels that hold together, what is weak
/// beside them, and pixels without depth that touch both. `motion`: [H, W] of Motion. Scattered
/// pixels, as noise makes them, are none. `scale`: pixels of the picture / (640 · 576).
ImageMask moving_regions(const ImageMask& motion, double scale);

}  // namespace mr::still
