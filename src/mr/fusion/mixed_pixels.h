#pragma once

#include "mr/fusion/ray_grid.h"

namespace mr::fusion {

/// Takes out mixed (flying) pixels: those that hang between a nearer surface on one side and a
/// farther one on the other, at most two pixels wide, and that continue neither of the two. A thin
/// pole stays, being nearer than both sides; a grazing floor stays, being straight in inverse
/// depth. Rows are compared only where their beams share light.
RayGrid drop_mixed_pixels(const RayGrid& grid, const RaySpacing& rays, const Precision& precision);

}  // namespace mr::fusion
