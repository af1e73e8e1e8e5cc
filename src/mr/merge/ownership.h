#pragma once

#include <span>
#include <vector>

#include "mr/merge/overlap.h"
#include "mr/merge/part.h"

namespace mr::merge {

/// Coherent ownership: every spot goes to the part that measured it best, by distance, angle and
/// how far it lies from the part's border (part_field.h). Both sides of a border between owners are
/// cut where the same two functions, smooth on their meshes, are equal: along nearly the same line.
/// Patches of less than a square decimetre go to who surrounds them. Returns what stays of each
/// part, in order, without views.
std::vector<Mesh> best_measured(std::span<const Part> parts, const OverlapConfig& config);

}  // namespace mr::merge
