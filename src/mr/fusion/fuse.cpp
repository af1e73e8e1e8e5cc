#include "mr/fusion/fuse.h"

#include "mr/fusion/marching_cubes.h"

namespace mr::fusion {

std::vector<Rect> patches(int width, int height, const FusionConfig& fusion) {
  if (fusion.decomposition != Decomposition::patches) return {{0, 0, width, height}};
  const auto column = [&](int i) { return width * i / fusion.patches_x; };
  const auto row = [&](int i) { return height * i / fusion.patches_y; };
  std::vector<Rect> out;
  for (int y = 0; y < fusion.patches_y; ++y)
    for (int x = 0; x < fusion.patches_x; ++x)
      out.push_back({column(x), row(y), column(x + 1) - column(x), row(y + 1) - row(y)});
  return out;
}

Mesh fuse_patch(const ImageDepth& depth, const Camera& camera, const Pose& T_world_camera,
                const VolumeConfig& volume, const Rect& patch) {
  VoxelVolume voxels(volume);
  voxels.integrate(depth, camera, T_world_camera, patch);
  return extract_surface(voxels);
}

}  // namespace mr::fusion
