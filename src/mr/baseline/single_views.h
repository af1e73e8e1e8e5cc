#pragma once

#include <span>

#include "mr/core/decoded_scene.h"
#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/scene/scene.h"

namespace mr::baseline {

/// Names of reconstructions where commands let choose one; no pipelines: nothing is coded.
inline constexpr const char* kSingleViews = "single-views";
inline constexpr const char* kLevelledViews = "levelled-views";

/// The grid of vertex_colored_scene(), each triangle textured by one picture: the peers of
/// blending. Views are chosen as by Waechter et al. 2014 (waechter.h). `are_levelled`: the pictures
/// are levelled at the seams as there; else they are shown as they are. `capture`: undistorted
/// frames. empty: there is no surface, or no sensor has colour. unsupported: a camera is a
/// panorama.
Result<DecodedScene> single_view_scene(const Scene& scene, std::span<const Frame> capture,
                                       bool are_levelled);

}  // namespace mr::baseline
