#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/frame.h"
#include "mr/core/mesh.h"
#include "mr/eval/geometry_error.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// How well a shown surface agrees with the raw depth of the sensors that it was made of
/// (docs/evaluation.md, Whole surfaces). A pixel counts where its depth is in the sensor's range
/// and its point in the scene's volume. What a pixel shows is the nearest triangle on its ray that
/// faces the sensor, as a viewer culls back faces.
struct DepthFit {
  std::uint64_t pixels = 0;  ///< that count, of every second column and row
  /// Share of them that show nothing, or something more than 3 voxels behind their depth.
  double hole_ratio = 0;
  double agreement = 0;  ///< share that shows something within 3 voxels along the ray
  /// Share whose point has nothing, whichever way it faces, within a voxel, and within three.
  double beyond_1_voxel = 0, beyond_3_voxels = 0;
};

/// Of all frames together. `capture`: undistorted. Every frame's sensor is in the scene, which is
/// prepared. All zero where no pixel counts. Parallel; the same on any number of threads.
DepthFit depth_fit(const Mesh& shown, const Scene& scene, std::span<const Frame> capture,
                   double voxel_m);

}  // namespace mr::eval
