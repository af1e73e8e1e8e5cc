#pragma once

#include "mr/fusion/ray_grid.h"

namespace mr::fusion {

/// Removes mixed (flying) pixels at depth edges: pixels between a nearer surface on one side and a
/// farther one on the other, in strips at most two pixels wide, that continue neither of the two. A
/// thin pole remains, since it is nearer than both sides; a grazing floor remains, since it is
/// linear in inverse depth. Rows are compared only if their beams overlap (RaySpacing::rows_touch).
RayGrid drop_mixed_pixels(const RayGrid& grid, const RaySpacing& rays, const Precision& precision);

}  // namespace mr::fusion
