#pragma once

#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"

namespace mr::still {

inline constexpr int kDepthTile_px = 8, kColorTile_px = 16;

/// The tiles of a depth picture that measure the still surface: most pixels are `confirmed` and
/// none is `moving`. Both masks have the picture's size.
TileMask confirmed_tiles(const ImageMask& confirmed, const ImageMask& moving);

/// The tiles of a colour picture in which no moving surface is visible, nor in a tile beside them.
/// `depth`, `moving`: of the depth camera at the same moment.
TileMask unoccluded_tiles(const ImageDepth& depth, const ImageMask& moving,
                          const Camera& depth_camera, const Camera& color_camera,
                          const Pose& T_color_depth);

/// A few rectangles that cover all set pixels with a margin of `around_px`, clipped to the picture.
/// They may overlap, and are fairly tight for upright shapes such as people.
std::vector<Rect> covering_rectangles(const ImageMask& mask, int around_px);

}  // namespace mr::still
