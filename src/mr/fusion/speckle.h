#pragma once

#include "mr/fusion/ray_grid.h"

namespace mr::fusion {

/// Takes out every region of fewer than `least_px` pixels. Pixels beside and above each other
/// belong to one region where a surface seen at three degrees, and noise, could make the step
/// between them. Linear in the pixels.
void drop_speckle(RayGrid& grid, const RaySpacing& rays, const Precision& precision, int least_px);

}  // namespace mr::fusion
