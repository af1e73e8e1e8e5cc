#pragma once

#include <vector>

#include "mr/core/camera.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"

namespace mr::merge {

/// The rays through the pixels of a posed pinhole camera.
struct RayGrid {
  Camera camera;
  Pose T_world_camera;
};

/// A depth camera's rays: those of a pinhole's pixels; for a LiDAR or an equirectangular camera,
/// the faces of a cube with the angular resolution of its columns or rows, whichever is finer, but
/// no finer than a quarter of a voxel at 3 m. They cover its vertical field, from the lowest to the
/// highest beam and half a row beyond.
std::vector<RayGrid> camera_rays(const SourceInfo& source, double voxel_m);

}  // namespace mr::merge
