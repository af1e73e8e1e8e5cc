#pragma once

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/pose.h"

/// Depth and colour of one sensor in each other's pixels, with a z-buffer: two cameras that lie
/// apart do not see the same, and the colour of what is in front must not end on what is behind.
namespace mr::sensor {

/// Depth in pixels of the colour camera, [H, W] of it; 0: nothing is seen there. Each block of 2x2
/// valid neighbours is a small surface, of which the nearest is kept; blocks whose depths lie
/// farther apart than those of a surface seen at 80 degrees are an edge, and left out.
ImageDepth depth_in_color(const ImageDepth& depth, const Camera& depth_camera,
                          const Camera& color_camera, const Pose& T_color_depth);

struct DepthColors {
  ImageRgb color;  ///< [H, W] of the depth camera; black where the colour camera sees nothing of it
  ImageMask seen;  ///< 1: the colour camera sees this depth pixel
};

/// The colour of each depth pixel, interpolated, where the colour camera sees it: neither outside
/// its picture nor hidden behind something else.
DepthColors color_for_depth(const ImageDepth& depth, const ImageRgb& color,
                            const Camera& depth_camera, const Camera& color_camera,
                            const Pose& T_color_depth);

}  // namespace mr::sensor
