#pragma once

#include "mr/planner/coverage.h"
#include "mr/planner/planner.h"

/// Trees in which each merger has a group of the sensors.
namespace mr::planner {

/// The best of several trees of sensor groups. Simpler ones come first: another must be clearly
/// faster.
Plan best_sensor_tree(const Coverage& coverage, const PlanConfig& config);

/// One merger for all.
Plan single_merger(const Coverage& coverage, const PlanConfig& config);

}  // namespace mr::planner
