#pragma once

#include "mr/fusion/ray_grid.h"

namespace mr::fusion {

/// Fills pixels that failed, as many do on dark or grazing surfaces, where two opposite neighbours
/// lie on one surface and the gap between them is at most `most_px` (up to RayGrid::kMargin - 1)
/// pixels: by the straight line between the two that agree best. Nothing grows past an edge. Rows
/// are compared only where their beams share light.
RayGrid fill_dropouts(const RayGrid& grid, const RaySpacing& rays, const Precision& precision,
                      int most_px);

}  // namespace mr::fusion
