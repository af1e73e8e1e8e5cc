#pragma once

#include <vector>

#include "mr/core/image.h"
#include "mr/fusion/fusion_config.h"
#include "mr/fusion/marching_cubes.h"
#include "mr/fusion/voxel_volume.h"

namespace mr::fusion {

/// The rectangles of a depth picture that are reconstructed apart. Decomposition none and chunks:
/// the whole picture. Decomposition patches: patches_x · patches_y of them, row by row (paper 5,
/// "local decomposition"); each gets a volume of its own, and between them lie gaps that merge::zip
/// closes.
std::vector<Rect> patches(int width, int height, const FusionConfig& fusion);

/// One depth frame after another → their surfaces (paper 3.1). Keeps its memory between frames.
class FrameFuser {
 public:
  explicit FrameFuser(const VolumeConfig& config, DepthEdges edges = DepthEdges::cut)
      : volume_(config), marching_cubes_(edges) {}

  /// The surface of a frame; good until the next, the caller's to change. `report`, where wanted:
  /// what became of it.
  Surface& fuse(const DepthFrame& frame, IntegrateReport* report = nullptr);

 private:
  VoxelVolume volume_;
  MarchingCubes marching_cubes_;
  Surface surface_;
};

}  // namespace mr::fusion
