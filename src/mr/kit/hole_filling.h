#pragma once

#include "mr/core/mesh.h"

namespace mr::kit {

/// Fills holes of at most `max_perimeter_m` around, which a few failed measurements leave in a
/// surface, with triangles between their own corners. Holes that touch another border stay, as does
/// one whose filling would face away from the surface around it or give an edge a third triangle.
/// No vertex moves, none is added. Runs are dropped where any hole was closed.
void fill_small_holes(Mesh& mesh, double max_perimeter_m);

}  // namespace mr::kit
