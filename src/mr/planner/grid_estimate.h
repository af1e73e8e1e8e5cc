#pragma once

#include <span>

#include "mr/planner/coverage.h"
#include "mr/planner/planner.h"

namespace mr::planner {

/// What one voxel grid for all sensors would take. `central`: the merger of all sensors, which says
/// how much several of them see.
GridEstimate estimate_grid(const Coverage& coverage, std::span<const SensorSample> samples,
                           const PlannedMerger& central);

}  // namespace mr::planner
