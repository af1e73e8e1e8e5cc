#pragma once

#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"

namespace mr::still {

inline constexpr int kDepthTile_px = 8, kColorTile_px = 16;

/// The tiles of a depth picture in which the still surface is measured: most pixels are
/// `confirmed`, none is `moving`. Masks of one size.
TileMask confirmed_tiles(const ImageMask& confirmed, const ImageMask& moving);

/// The tiles of a colour picture in which nothing that moves shows, one tile around it included.
/// `depth`, `moving`: of the depth camera, which sees the same moment.
TileMask unoccluded_tiles(const ImageDepth& depth, const ImageMask& moving,
                          const Camera& depth_camera, const Camera& color_camera,
                          const Pose& T_color_depth);

/// Rectangles that together hold all that is set, with `around_px` around it (inside the picture);
/// they may overlap. Few, and not much larger than they must be where what is set stands upright.
std::vector<Rect> covering_rectangles(const ImageMask& mask, int around_px);

}  // namespace mr::still
