#include "mr/node/plans.h"

namespace mr::node {
namespace {

// Of decimation, of what moves: people alone cannot spare as many triangles as people with walls.
constexpr double kMovingError_voxels = 0.5;
// Of what stays: it is sent once, so it may be finer than what a capture can tell.
constexpr double kStillError_voxels = 0.4;

/// An error limit alone decides alone.
Decimation decimation_of(const SimplifyConfig& config) {
  const bool has_ratio = config.ratio < 1 || config.error_m <= 0;
  return {has_ratio ? config.ratio : 0, config.error_m};
}

}  // namespace

CodingPlan sensor_plan(const Scene& scene, SensorId sensor) {
  CodingPlan plan;
  plan.decimation = decimation_of(scene.simplify);
  plan.texture_qp = scene.coding.sensor_texture_qp;
  const bool stands_still = scene.sensor(sensor).T_world_depth.size() == 1;
  if (scene.still.layers && stands_still) {
    if (plan.decimation.error_m <= 0) plan.decimation.error_m = kMovingError_voxels * scene.voxel_m;
    plan.still_error_m = kStillError_voxels * scene.voxel_m;
  }
  return plan;
}

CodingPlan merger_plan(const Scene& scene, bool is_root) {
  CodingPlan plan;
  if (is_root) plan.decimation = decimation_of(scene.merge.simplify);
  plan.texture_scale = scene.coding.texture_scale, plan.texture_qp = scene.coding.texture_qp;
  return plan;
}

}  // namespace mr::node
