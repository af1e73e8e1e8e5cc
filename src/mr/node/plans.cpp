#include "mr/node/plans.h"

#include <algorithm>

#include "mr/rate/grid.h"

namespace mr::node {
namespace {

// Error limit for decimating the moving surface: a ratio alone would decimate people too much where
// no walls share the triangle budget.
constexpr double kMovingError_voxels = 0.5;
// Error limit for the still surface: it is sent once, so it may be finer than one capture's noise.
constexpr double kStillError_voxels = rate::kStillNodes_voxels[0];

// QP steps: plates are encoded seldom and shown for long.
constexpr int kPlatesFiner = 8;

/// If the scene sets an error limit and no ratio, only the error limit applies.
Decimation decimation_of(const SimplifyConfig& config) {
  const bool has_ratio = config.ratio < 1 || config.error_m <= 0;
  return {has_ratio ? config.ratio : 0, config.error_m};
}

}  // namespace

CodingPlan sensor_plan(const Scene& scene, SensorId sensor) {
  CodingPlan plan;
  plan.decimation = decimation_of(scene.simplify);
  plan.texture_qp = scene.coding.sensor_texture_qp;
  const bool stands_still = !scene.sensor(sensor).is_moving();
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
  plan.plate_scale = plan.texture_scale;
  plan.plate_qp = std::max(plan.texture_qp - kPlatesFiner, 0);
  return plan;
}

Decimation moving_decimation(const Scene& scene, double error_voxels) {
  return {0, error_voxels * scene.voxel_m};
}

ScenePlan scene_plan(const Scene& scene, double error_voxels) {
  ScenePlan out;
  for (const SensorId id : all_sensors(scene.sensors)) {
    CodingPlan& plan = out.by_sensor[id] = sensor_plan(scene, id);
    plan.decimation = moving_decimation(scene, error_voxels);
  }
  out.sensors = out.by_sensor.begin()->second;
  std::erase_if(out.by_sensor, [&](const auto& item) { return item.second == out.sensors; });
  out.root = merger_plan(scene, true);
  out.root.decimation = moving_decimation(scene, error_voxels);
  return out;
}

}  // namespace mr::node
