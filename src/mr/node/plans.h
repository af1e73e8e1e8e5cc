#pragma once

#include <cstdint>
#include <mutex>
#include <utility>

#include "mr/core/coding_plan.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// The plan that a sensor begins with, as the scene has it.
CodingPlan sensor_plan(const Scene& scene, SensorId sensor);

/// The same of a merger. Only the root decimates.
CodingPlan merger_plan(const Scene& scene, bool is_root);

/// The plan that a node is to work by: the scene's until it is given another. Thread-safe.
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
