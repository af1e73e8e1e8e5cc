#include "mr/node/surface_reconstructor.h"

#include <algorithm>
#include <utility>

#include "mr/codec/mesh_codec.h"
#include "mr/core/parallel.h"
#include "mr/kit/hole_filling.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/seam/zipper.h"

namespace mr::node {
namespace {

constexpr double kPinhole_voxels = 12;  // around: what a few failed pixels leave

fusion::VolumeConfig volume_config(const Scene& scene) {
  return {.voxel_m = scene.voxel_m,
          .truncation_m = scene.fusion.truncation_m,
          .bounds = scene.volume,
          .chunk_m = scene.fusion.chunk_m,
          .history = fusion::History::none};
}

simplify::SimplifyOptions limits_of(const Decimation& decimation, const Mesh& mesh) {
  simplify::SimplifyOptions out;
  if (decimation.ratio > 0) out.triangles = simplify::triangles_at(mesh, decimation.ratio);
  if (decimation.error_m > 0) out.error_m = static_cast<float>(decimation.error_m);
  return out;
}

/// Of some rectangles, as much as holds measurements.
std::vector<Rect> measured_parts(const ImageDepth& depth, const std::vector<Rect>& rects) {
  std::vector<Rect> out;
  for (const Rect& r : rects) {
    int left = r.x + r.width, top = r.y + r.height, right = r.x, bottom = r.y;  // ends beyond
    for (int y = r.y; y < r.y + r.height; ++y)
      for (int x = r.x; x < r.x + r.width; ++x)
        if (*depth.at(x, y) > 0) {
          left = std::min(left, x), right = std::max(right, x + 1);
          top = std::min(top, y), bottom = y + 1;
        }
    if (left < right) out.push_back({left, top, right - left, bottom - top});
  }
  return out;
}

}  // namespace

SurfaceReconstructor::Patch SurfaceReconstructor::reconstruct_patch(const ImageDepth& depth,
                                                                    const Pose& T_world_depth,
                                                                    const Rect& rect,
                                                                    const Decimation& decimation,
                                                                    PatchWorker& worker) const {
  Patch out;
  Mesh* fused = nullptr;
  fusion::IntegrateReport report;
  {
    const Stopwatch stopwatch(out.fuse_ms);
    fused = &worker.fuser
                 .fuse({.depth = depth,
                        .camera = *camera_,
                        .T_world_camera = T_world_depth,
                        .region = rect,
                        .precision = sensor_->precision,
                        .slanted = true},
                       &report)
                 .mesh;
  }
  out.usable = report.usable;
  const Stopwatch stopwatch(out.simplify_ms);
  kit::fill_small_holes(*fused, kPinhole_voxels * scene_->voxel_m);
  out.surface.fused_triangles = fused->triangles.size();
  auto small = worker.simplifier.run(*fused, limits_of(decimation, *fused));
  if (!small) {  // what the camera saw lies too far away
    out.usable = false;
    return out;
  }
  out.surface.errors.raise(small->mesh, small->errors_m, scene_->fusion.chunk_m);
  out.surface.mesh = merge::remove_islands(small->mesh, merge::island_area_m2(scene_->voxel_m));
  return out;
}

/// Patches were reconstructed apart: the gaps between them are closed like those between sensors.
Result<SurfaceReconstructor::Surface> SurfaceReconstructor::join(
    const std::vector<Patch>& patches) const {
  Surface out;
  std::vector<Mesh> parts;
  for (const Patch& patch : patches) {
    parts.push_back(patch.surface.mesh);
    out.errors.raise(patch.surface.errors);
    out.fused_triangles += patch.surface.fused_triangles;
  }
  auto snapped = codec::snap_to_lattice(merge::zip(parts, merge::zipper_config(scene_->voxel_m)),
                                        scene_->lattice);
  if (!snapped) return snapped.error();
  out.mesh = kit::without_nonmanifold_edges(*snapped);
  return out;
}

Result<SurfaceReconstructor::Surface> SurfaceReconstructor::run(const ImageDepth& depth,
                                                                const Pose& T_world_depth,
                                                                const Decimation& decimation) {
  const auto rects =
      measured_parts(depth, fusion::patches(depth.width, depth.height, scene_->fusion));
  while (workers_.size() < rects.size())
    workers_.push_back({fusion::FrameFuser(volume_config(*scene_)), {}});
  std::vector<Patch> patches(rects.size());
  parallel_for(patches.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      isolated([&] {
        patches[i] = reconstruct_patch(depth, T_world_depth, rects[i], decimation, workers_[i]);
      });
  });
  if (!std::ranges::all_of(patches, &Patch::usable))
    return Error{Error::Cause::invalid,
                 "camera or pose cannot be used (not a rotation, not finite, or farther than 1000 "
                 "km)"};
  double fuse_ms = 0, simplify_ms = 0;
  for (const Patch& patch : patches) fuse_ms += patch.fuse_ms, simplify_ms += patch.simplify_ms;
  auto joined = [&] {
    const Stopwatch stopwatch(simplify_ms);
    return join(patches);
  }();
  trace_->add("fuse", fuse_ms);
  trace_->add("simplify", simplify_ms);
  return joined;
}

}  // namespace mr::node
