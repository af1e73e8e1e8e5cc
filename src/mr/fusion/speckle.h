#pragma once

#include "mr/fusion/ray_grid.h"

namespace mr::fusion {

/// Removes connected components of fewer than `least_px` pixels (run-based labelling with
/// union-find, 4-connected). Neighbouring pixels are connected when noise and a surface seen at
/// three degrees could explain the step between them. Linear time.
void drop_speckle(RayGrid& grid, const RaySpacing& rays, const Precision& precision, int least_px);

}  // namespace mr::fusion
