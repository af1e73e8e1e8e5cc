#pragma once

#include <functional>

#include "mr/core/image.h"

namespace mr::still {

/// The regions that move (DESIGN section 9): pixels of `strong` that hold together, what is weak
/// beside them, and pixels without depth that touch either. Scattered pixels, as noise makes them,
/// are none.
///   strong    clearly nearer than what stays, or nothing is known to stay there
///   no_depth  nothing is measured, or nothing that counts: hair and dark clothes have such holes,
///             which cleaning closes where they are part of what moves
///   is_weak   (x, y) of a pixel that counts beside strong ones: feet on the floor
///   scale     pixels of the picture / (640 · 576)
ImageMask moving_regions(const ImageMask& strong, const ImageMask& no_depth,
                         const std::function<bool(int, int)>& is_weak, double scale);

}  // namespace mr::still
