#pragma once

#include <optional>

#include "mr/planner/coverage.h"
#include "mr/planner/cube_box.h"
#include "mr/planner/planner.h"

/// Trees in which each merger owns a box of the chunk grid.
namespace mr::planner {

/// All that any sensor can see, in cubes.
CubeBox space_of(const Coverage& coverage);

/// A tree of mergers with regions; nothing when the space has too few cubes.
std::optional<Plan> region_tree(const Coverage& coverage, const PlanConfig& config);

}  // namespace mr::planner
