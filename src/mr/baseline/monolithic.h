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

/// All sensors of a capture in one voxel grid: one TSDF, marching cubes, small islands removed; not
/// decimated. `capture`: undistorted frames (node::CaptureReader). What Holoportation transmits,
/// and the reference for scenes without a known truth.
Mesh fuse_all(const Scene& scene, std::span<const Frame> capture, double voxel_m);

/// The depth of one sensor as fusion takes it (node::prepare_depth).
struct PreparedDepth {
  ImageDepth depth;
  Camera camera;  ///< undistorted
  Pose T_world_depth;
};

/// The second half of fuse_all().
Mesh fuse_prepared(const Scene& scene, std::span<const PreparedDepth> depths, double voxel_m);

/// The colour cameras of a capture as views, by id; each fills a picture of its own (stream = id).
std::vector<View> color_views(const Scene& scene, std::span<const Frame> capture);

}  // namespace mr::baseline
