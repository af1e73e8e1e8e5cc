#pragma once

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/fusion/fusion_config.h"

namespace mr::fusion {

/// What a sensor delivers, made fit for fusion: depth that is no positive number becomes 0
/// (invalid); then, each as `config` asks for it, mixed pixels go, holes are filled, speckle goes,
/// noise is averaged out. `camera`: of that depth, undistorted and of its size; pinhole depth is
/// along z, of the other models along the ray. `readings`: how many each pixel is the mean of: what
/// may be noise is √readings times less than `precision` says, and what differs by more stays.
/// Where no step did anything, depth keeps its bytes. Parallel; the same bytes on any number of
/// threads.
ImageDepth clean_depth(const ImageDepth& depth, const Camera& camera, const Precision& precision,
                       const CleanConfig& config, int readings = 1);

}  // namespace mr::fusion
