#pragma once

#include <span>

#include "mr/planner/coverage.h"
#include "mr/planner/planner.h"

namespace mr::planner {

/// Estimates time and memory of one voxel grid for all sensors. `central`: the merger of all
/// sensors, from which the overlap follows.
GridEstimate estimate_grid(const Coverage& coverage, std::span<const SensorSample> samples,
                           const PlannedMerger& central);

}  // namespace mr::planner
