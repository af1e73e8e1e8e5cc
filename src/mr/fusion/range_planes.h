#pragma once

#include <vector>

#include "mr/fusion/frame_view.h"
#include "mr/fusion/integrate_kernels.h"

namespace mr::fusion {

/// Fills the planes of a picture from its pixels (parallel over rows). Neighbours count as
/// one surface where the line through them is not too nearly a ray, or goes on straight beyond: so
/// a floor far away is one sheet, and a step in range is not bridged.
void fit_planes(FrameView& view);

/// Appends boxes that hold the planes of row `y`, each as far as half way to its neighbours: pixels
/// of a range picture may lie many voxels apart.
void plane_ranges(const FrameView& view, int y, float margin_blocks, std::vector<VoxelRange>& out);

/// The same of those pixels of a slanted pinhole's tile that lie too far apart for the margin
/// around their points: of surface that is seen at a flat angle.
void steep_ranges(const FrameView& view, const Rect& tile, float margin_blocks,
                  std::vector<VoxelRange>& out);

}  // namespace mr::fusion
