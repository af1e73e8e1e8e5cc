#pragma once

#include "mr/fusion/ray_grid.h"

namespace mr::fusion {

/// Fills pixels that failed, as many do on dark or grazing surfaces, where two opposite neighbours
/// lie on one surface and the gap between them is at most `most_px` (up to RayGrid::kMargin - 1)
/// pixels: by the straight line between the two that agree best. Nothing grows past an edge. Rows
/// are compared only where their beams share light. `is_exact`: the depth is so exact that two
/// pixels tell a slope; then the slopes on both sides must lead across, else the gap is a depth
/// edge's.
RayGrid fill_dropouts(const RayGrid& grid, const RaySpacing& rays, const Precision& precision,
                      int most_px, bool is_exact = false);

}  // namespace mr::fusion
