#pragma once

#include "mr/core/mesh.h"
#include "mr/fusion/voxel_volume.h"

namespace mr::fusion {

/// The zero surface of a volume (Lorensen & Cline 1987): vertices shared between cells and blocks,
/// triangles counter-clockwise seen from the free side, in block order. Cells of which a corner was
/// never seen stay empty, and so do cells in which free space beyond the truncation band meets
/// the inside directly: that is a depth discontinuity, not a surface. Parallel over blocks; the
/// same bytes on any number of threads.
Mesh extract_surface(const VoxelVolume& volume);

}  // namespace mr::fusion
