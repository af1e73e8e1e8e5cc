#pragma once

#include <cstdint>

#include "mr/core/image.h"

namespace mr::atlas {

/// A visible watermark: paints the lowest 16 bits of a number into the picture's upper left corner,
/// 2 rows of 8 squares of 16 pixels, white for 1, most significant first. For tests that mesh and
/// texture belong together: a viewer reads it back from the rendered picture.
void draw_watermark(ImageRgb& picture, std::uint64_t number);

}  // namespace mr::atlas
