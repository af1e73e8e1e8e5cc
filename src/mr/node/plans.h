#pragma once

#include <cstdint>
#include <mutex>
#include <utility>

#include "mr/core/coding_plan.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// A sensor's initial plan, from the scene file.
CodingPlan sensor_plan(const Scene& scene, SensorId sensor);

/// A merger's initial plan. Only the root decimates.
CodingPlan merger_plan(const Scene& scene, bool is_root);

/// Decimation of the moving surface to an error limit in voxels, as rate control varies it.
Decimation moving_decimation(const Scene& scene, double error_voxels);

/// The initial plans of all nodes of a scene with layers or without, but with that decimation.
ScenePlan scene_plan(const Scene& scene, double error_voxels);

/// A node's plan in force: the initial one until set() is called. Thread-safe.
class CurrentPlan {
 public:
  explicit CurrentPlan(CodingPlan plan) : plan_(std::move(plan)) {}

  void set(const CodingPlan& plan) {
    const std::lock_guard lock(mutex_);
    plan_ = plan;
  }
  CodingPlan get() const {
    const std::lock_guard lock(mutex_);
    return plan_;
  }

 private:
  mutable std::mutex mutex_;
  CodingPlan plan_;
};

}  // namespace mr::node
