#pragma once

#include <span>
#include <vector>

#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"

namespace mr::merge {

/// Coherent ownership: every spot goes to the part that measured it best, by distance, angle and
/// how much of it there is around (quality_grid.h). That is a function of space: both sides of a
/// border between owners are cut where the same two values are equal. Returns what stays of each
/// part, in order, each triangle with the sensor that measured it as its view. `memory` may be
/// null.
std::vector<Mesh> best_measured(std::span<const kit::Part> parts, const OverlapConfig& config,
                                QualityMemory* memory);

}  // namespace mr::merge
