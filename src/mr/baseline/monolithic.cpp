#include "mr/baseline/monolithic.h"

#include <algorithm>

#include "mr/fusion/marching_cubes.h"
#include "mr/fusion/voxel_volume.h"
#include "mr/merge/islands.h"
#include "mr/node/capture.h"
#include "mr/sensor/registration.h"

namespace mr::baseline {

Mesh fuse_all(const Scene& scene, std::span<const Frame> capture, double voxel_m) {
  std::vector<PreparedDepth> depths;
  for (const Frame& frame : capture) {
    const Camera camera = undistorted_whole(scene.sensor(frame.sensor).depth_camera);
    depths.push_back({node::prepare_depth(scene, camera, frame), camera, frame.T_world_depth});
  }
  return fuse_prepared(scene, depths, voxel_m);
}

Mesh fuse_prepared(const Scene& scene, std::span<const PreparedDepth> depths, double voxel_m) {
  const double truncation_m = std::max(scene.fusion.truncation_m, 4 * voxel_m);
  fusion::VoxelVolume volume(
      {.voxel_m = voxel_m,
       .truncation_m = truncation_m,
       .bounds = scene.volume,
       .most_blocks = std::size_t{1} << 24});  // a reference leaves nothing out
  for (const PreparedDepth& d : depths)
    volume.integrate({.depth = d.depth,
                      .camera = d.camera,
                      .T_world_camera = d.T_world_depth,
                      .region = {0, 0, d.depth.width, d.depth.height},
                      .precision = {}});
  return merge::remove_islands(fusion::extract_surface(volume), merge::island_area_m2(voxel_m));
}

std::vector<View> color_views(const Scene& scene, std::span<const Frame> capture) {
  std::vector<View> views;
  for (const Frame& frame : capture) {
    if (frame.color.empty()) continue;
    const sensor::Registration registration(scene.sensor(frame.sensor), frame.sensor);
    auto view = registration.color_view(frame.T_world_depth);
    if (!view) continue;
    view->stream = stream_of(frame.sensor);
    views.push_back(*view);
  }
  std::sort(views.begin(), views.end(), [](const View& a, const View& b) { return a.id < b.id; });
  return views;
}

}  // namespace mr::baseline
