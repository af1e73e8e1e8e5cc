#pragma once

#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/scene.h"
#include "mr/fusion/voxel_volume.h"

namespace mr::fusion {

/// One depth frame → its surface (paper 3.1). Decomposition none and chunks: one mesh from one
/// volume. Decomposition patches: patches_x · patches_y meshes, row by row, each from a volume of
/// its own that sees only its rectangle of the picture (paper 5, "local decomposition"), so that
/// they can be decimated and coded apart; between them lie gaps that merge::zip closes.
std::vector<Mesh> fuse_frame(const ImageDepth& depth, const Camera& camera,
                             const Pose& T_world_camera, const VolumeConfig& volume,
                             const FusionConfig& fusion);

}  // namespace mr::fusion
