#pragma once

#include <cstddef>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/coding_plan.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/fusion/fuse.h"
#include "mr/node/chunk_grid.h"
#include "mr/scene/scene.h"
#include "mr/simplify/simplify.h"

namespace mr::node {

/// Reconstructs and decimates the surface in a sensor's depth picture (paper 3.1), patch by patch
/// (paper 5): a patch is decimated as soon as it is fused. Keeps memory from frame to frame, and
/// nothing else. Not thread-safe; uses the caller's arena.
class SurfaceReconstructor {
 public:
  struct Surface {
    Mesh mesh;  ///< decimated, on the lattice
    CubeErrors errors;
    std::size_t fused_triangles = 0;  ///< before decimation
  };

  /// `camera`: undistorted. All must outlive this.
  SurfaceReconstructor(const Scene& scene, const SensorConfig& sensor, const Camera& camera,
                       Trace& trace)
      : scene_(&scene), sensor_(&sensor), camera_(&camera), trace_(&trace) {}

  /// `depth`: cleaned. An empty surface where nothing is in the volume.
  Result<Surface> run(const ImageDepth& depth, const Pose& T_world_depth,
                      const Decimation& decimation);

 private:
  struct Patch {
    Surface surface;  ///< not on the lattice yet
    double fuse_ms = 0, simplify_ms = 0;
    bool usable = true;
  };
  /// What keeps its memory from frame to frame.
  struct PatchWorker {
    fusion::FrameFuser fuser;
    simplify::Simplifier simplifier;
  };

  Patch reconstruct_patch(const ImageDepth& depth, const Pose& T_world_depth, const Rect& rect,
                          const Decimation& decimation, PatchWorker& worker) const;
  Result<Surface> join(const std::vector<Patch>& patches) const;

  const Scene* scene_;
  const SensorConfig* sensor_;
  const Camera* camera_;
  Trace* trace_;
  std::vector<PatchWorker> workers_;  ///< one per patch
};

}  // namespace mr::node
