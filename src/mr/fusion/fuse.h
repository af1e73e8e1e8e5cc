#pragma once

#include <vector>

#include "mr/core/image.h"
#include "mr/fusion/fusion_config.h"
#include "mr/fusion/marching_cubes.h"
#include "mr/fusion/voxel_volume.h"

namespace mr::fusion {

/// The rectangles of a depth picture that are reconstructed independently. Decomposition none and
/// chunks: the whole picture. Decomposition patches: patches_x · patches_y of them, row by row
/// (paper 5, "local decomposition"); each gets a volume of its own, and between them lie gaps that
/// merge::zip closes.
std::vector<Rect> patches(int width, int height, const FusionConfig& fusion);

/// Reconstructs the surface of one depth frame after another (paper 3.1): TSDF, then marching
/// cubes. Reuses its memory between frames.
class FrameFuser {
 public:
  explicit FrameFuser(const VolumeConfig& config, DepthEdges edges = DepthEdges::cut)
      : volume_(config), marching_cubes_(edges) {}

  /// The surface of a frame, valid until the next call; the caller may modify it. `report`:
  /// statistics of the integration; may be null.
  Surface& fuse(const DepthFrame& frame, IntegrateReport* report = nullptr);

 private:
  VoxelVolume volume_;
  MarchingCubes marching_cubes_;
  Surface surface_;
};

}  // namespace mr::fusion
