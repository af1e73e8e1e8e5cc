#pragma once

#include "mr/fusion/ray_grid.h"

namespace mr::fusion {

/// Fills small holes in depth (dropouts), as they occur on dark or grazing surfaces: an invalid
/// pixel is interpolated linearly, in inverse depth, between two opposite neighbours that lie on
/// one surface at most `most_px` (up to RayGrid::kMargin - 1) invalid pixels apart; of the four
/// directions the one whose ends agree best. Surfaces do not grow beyond depth edges. Rows are
/// compared only if their beams overlap (RaySpacing::rows_touch). `is_exact`: the depth is so
/// precise that two pixels determine a slope; then the slopes on both sides must also agree with
/// the interpolation, otherwise the gap belongs to a depth edge.
RayGrid fill_dropouts(const RayGrid& grid, const RaySpacing& rays, const Precision& precision,
                      int most_px, bool is_exact = false);

}  // namespace mr::fusion
