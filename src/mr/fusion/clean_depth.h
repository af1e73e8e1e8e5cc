#pragma once

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/fusion/fusion_config.h"

namespace mr::fusion {

/// Filters a sensor's depth for fusion. Depth that is no positive number becomes 0 (invalid). Then,
/// as enabled in `config`: removes mixed pixels, fills holes, removes speckle and smooths noise.
/// `camera`: of this depth picture, undistorted and of its size; a pinhole's depth is along z, that
/// of other models along the ray. `readings`: the number of measurements averaged in each pixel;
/// the assumed noise is `precision` / √readings. Pixels that no step changes keep their exact
/// bytes. Parallel; the same bytes on any number of threads.
ImageDepth clean_depth(const ImageDepth& depth, const Camera& camera, const Precision& precision,
                       const CleanConfig& config, int readings = 1);

}  // namespace mr::fusion
