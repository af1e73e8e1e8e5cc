#pragma once

#include <vector>

#include "mr/fusion/frame_view.h"
#include "mr/fusion/integrate_kernels.h"

namespace mr::fusion {

/// Fits the tangent plane of every pixel of a range picture to its neighbours (parallel over rows).
/// Neighbours belong to one surface when the line through them is not nearly parallel to a ray, or
/// when it continues straight: so a distant floor is one surface, and a depth discontinuity is not
/// bridged.
void fit_range_planes(FrameView& view);

/// Appends boxes of voxels that contain the plane patches of row `y`. A patch reaches half-way to
/// the neighbouring pixels, which in a range picture may be many voxels apart.
void plane_ranges(const FrameView& view, int y, float margin_blocks, std::vector<VoxelRange>& out);

/// The same for a tile of a pinhole with DepthFrame::slanted: only for pixels of grazing surfaces,
/// whose points lie too far apart for the margin around them.
void steep_ranges(const FrameView& view, const Rect& tile, float margin_blocks,
                  std::vector<VoxelRange>& out);

}  // namespace mr::fusion
