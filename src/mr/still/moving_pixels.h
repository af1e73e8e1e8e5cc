#pragma once

#include <functional>

#include "mr/core/image.h"

namespace mr::still {

/// The moving regions of a depth picture (docs/layers.md), by hysteresis thresholding: connected
/// components of `strong` pixels that are large enough, weak pixels beside them, and pixels without
/// depth that touch either. Scattered pixels are noise and do not count.
///   strong    clearly nearer than the background, or the background is unknown
///   no_depth  no valid depth: holes of hair and dark clothes, which the depth filter fills later
///   if
///             they are part of a moving region
///   is_weak   (x, y): whether a pixel joins adjacent strong ones, such as feet on the floor
///   scale     pixels of the picture / (640 · 576)
ImageMask moving_regions(const ImageMask& strong, const ImageMask& no_depth,
                         const std::function<bool(int, int)>& is_weak, double scale);

}  // namespace mr::still
