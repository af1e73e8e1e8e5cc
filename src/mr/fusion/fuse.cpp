#include "mr/fusion/fuse.h"

#include "mr/core/parallel.h"
#include "mr/fusion/marching_cubes.h"

namespace mr::fusion {
namespace {

/// Rectangle (column, row) of a grid of patches that covers the picture.
Rect patch_rect(int width, int height, const FusionConfig& fusion, int column, int row) {
  const int x0 = width * column / fusion.patches_x, x1 = width * (column + 1) / fusion.patches_x;
  const int y0 = height * row / fusion.patches_y, y1 = height * (row + 1) / fusion.patches_y;
  return {x0, y0, x1 - x0, y1 - y0};
}

}  // namespace

std::vector<Mesh> fuse_frame(const ImageDepth& depth, const Camera& camera,
                             const Pose& T_world_camera, const VolumeConfig& volume,
                             const FusionConfig& fusion) {
  const auto fuse_region = [&](const Rect& region) {
    VoxelVolume voxels(volume);
    voxels.integrate(depth, camera, T_world_camera, region);
    return extract_surface(voxels);
  };
  if (fusion.decomposition != Decomposition::patches)
    return {fuse_region({0, 0, depth.width, depth.height})};

  std::vector<Mesh> patches(static_cast<std::size_t>(fusion.patches_x) * fusion.patches_y);
  parallel_for(patches.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      patches[i] = fuse_region(patch_rect(depth.width, depth.height, fusion,
                                          static_cast<int>(i) % fusion.patches_x,
                                          static_cast<int>(i) / fusion.patches_x));
  });
  return patches;
}

}  // namespace mr::fusion
