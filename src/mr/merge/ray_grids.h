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

/// The rays of several depth cameras: `sparse` ones meet a surface 3 m away about once a voxel, and
/// `dense` ones twice as often where the camera has the pixels for it.
struct RayGrids {
  std::vector<RayGrid> sparse, dense;
};

/// Adds a depth camera's rays. A pinhole's go through its pixels, or through more where those are
/// far apart. Those of a LiDAR or an equirectangular camera go through the faces of a cube, as
/// near together as its columns or rows, whichever are the nearer, but at 3 m no nearer than a
/// quarter of a voxel, and cover its field: from its lowest to its highest beam, and half a row
/// beyond.
void add_ray_grids(const SourceInfo& source, double voxel_m, RayGrids& grids);

}  // namespace mr::merge
