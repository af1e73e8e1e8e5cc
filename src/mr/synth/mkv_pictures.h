#pragma once

#include <cstddef>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/frame.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

/// Pictures as the blocks of an Azure Kinect's recording hold them.
namespace mr::synth {

enum class MkvColor { mjpg, nv12, yuy2, bgra };

/// A colour picture of even size. NV12 and YUY2 are BT.601, limited range, as libyuv and the SDK's
/// viewer take them. Error: the JPEG encoder's.
Result<std::vector<std::byte>> mkv_color(const ImageRgb& picture, MkvColor format,
                                         int jpeg_quality);

/// Depth as 16-bit millimetres, high byte first.
std::vector<std::byte> mkv_depth(const ImageDepth& depth);

/// An infrared picture in the geometry of depth, high byte first: what the sensor's own light
/// brings back, by the brightness of the colour picture and the distance.
std::vector<std::byte> mkv_infrared(const ImageDepth& depth, const Camera& depth_camera,
                                    const ImageRgb& color, const Camera& color_camera,
                                    const Pose& T_color_depth);

}  // namespace mr::synth
