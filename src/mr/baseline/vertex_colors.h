#pragma once

#include <span>

#include "mr/core/decoded_scene.h"
#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/scene/scene.h"

namespace mr::baseline {

/// The name of this reconstruction where commands let choose one. It is no pipeline: nothing is
/// coded.
inline constexpr const char* kVertexColors = "vertex-colors";

/// What the colour volumes of KinectFusion's successors and of Open3D show (Whelan et al. 2013,
/// "Robust Real-Time Visual Odometry for Dense RGB-D Mapping"): one grid of all sensors at the
/// scene's voxel (fuse_all), each vertex with the mean colour of all cameras that see it, weighted
/// by the cosine of the angle between its normal and the line of sight. A camera sees a vertex that
/// lies in its picture, faces it, and has no surface of the grid more than two voxels before it.
/// The others get the mean of their coloured neighbours, ring by ring. `capture`: undistorted
/// frames. empty: there is no surface, or no sensor has colour.
Result<DecodedScene> vertex_colored_scene(const Scene& scene, std::span<const Frame> capture);

}  // namespace mr::baseline
