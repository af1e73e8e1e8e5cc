#pragma once

#include "mr/core/mesh.h"

namespace mr::kit {

/// Fills holes with a perimeter of at most `max_perimeter_m`, as single failed measurements leave
/// them, by triangulating their border loops. Holes that touch another border stay open, and so do
/// those whose triangles would face away from the surface around or give an edge a third triangle.
/// No vertex is moved or added. Runs are cleared if any hole was filled.
void fill_small_holes(Mesh& mesh, double max_perimeter_m);

}  // namespace mr::kit
