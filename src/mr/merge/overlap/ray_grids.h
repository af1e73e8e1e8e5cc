#pragma once

#include <vector>

#include "mr/core/camera.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"

namespace mr::merge {

/// Rays from one place, through the pixels of a pinhole picture.
struct RayGrid {
  Camera camera;
  Pose T_world_camera;
};

/// A depth camera's rays: a pinhole's through its pixels, those of a LiDAR or an equirectangular
/// camera through the faces of a cube, as near together as its columns or rows, whichever are the
/// nearer, but at 3 m no nearer than a quarter of a voxel, and as far around as its field: from its
/// lowest to its highest beam, and half a row beyond.
std::vector<RayGrid> camera_rays(const SourceInfo& source, double voxel_m);

}  // namespace mr::merge
