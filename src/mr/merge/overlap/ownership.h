#pragma once

#include <span>
#include <vector>

#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"

namespace mr::merge {

/// Coherent ownership: every point of the surface belongs to the part that measured it best, by
/// distance, angle and the amount of surface around it (quality_grid.h). Quality is a function of
/// space, so the meshes on both sides of a border are cut along the same line, where the two
/// qualities are equal. Where that line lies elsewhere on each side, one of the parts keeps what
/// none would. What remains is moved to the mean of all parts that have surface there. Returns the
/// remaining mesh of each part, in order; a triangle's view is the sensor that measured it.
/// `memory` may be null.
std::vector<Mesh> best_measured(std::span<const kit::Part> parts, const OverlapConfig& config,
                                QualityMemory* memory);

}  // namespace mr::merge
