#pragma once

#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/scene.h"
#include "mr/fusion/voxel_volume.h"

namespace mr::fusion {

/// The rectangles of a depth picture that are reconstructed apart. Decomposition none and chunks:
/// the whole picture. Decomposition patches: patches_x · patches_y of them, row by row (paper 5,
/// "local decomposition").
std::vector<Rect> patches(int width, int height, const FusionConfig& fusion);

/// One patch of a depth frame → its surface (paper 3.1), from a volume of its own that sees only
/// its rectangle. Between patches lie gaps that merge::zip closes.
Mesh fuse_patch(const ImageDepth& depth, const Camera& camera, const Pose& T_world_camera,
                const VolumeConfig& volume, const Rect& patch);

}  // namespace mr::fusion
