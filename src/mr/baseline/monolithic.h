#pragma once

#include <span>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/frame.h"
#include "mr/core/mesh.h"
#include "mr/core/result.h"
#include "mr/core/view.h"
#include "mr/scene/scene.h"

namespace mr::baseline {

/// Fuses all sensors of a capture in one voxel grid: one TSDF, marching cubes, removal of small
/// islands, no decimation. `capture`: undistorted frames (node::CaptureReader). This is what
/// Holoportation transmits, and the reference for scenes without known ground truth.
Mesh fuse_all(const Scene& scene, std::span<const Frame> capture, double voxel_m);

/// The filtered depth of one sensor, ready for fusion (node::prepare_depth).
struct PreparedDepth {
  ImageDepth depth;
  Camera camera;  ///< undistorted
  Pose T_world_depth;
};

/// The second step of fuse_all(): fusion of prepared depth.
Mesh fuse_prepared(const Scene& scene, std::span<const PreparedDepth> depths, double voxel_m);

/// The colour cameras of a capture as views, by id; each fills a picture of its own (stream = id).
std::vector<View> color_views(const Scene& scene, std::span<const Frame> capture);

}  // namespace mr::baseline
