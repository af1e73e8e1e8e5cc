#pragma once

#include "mr/fusion/ray_grid.h"

namespace mr::fusion {

/// A separable bilateral filter (Tomasi and Manduchi 1998; for depth, Newcombe et al. 2011) against
/// sensor noise and quantisation that preserves depth edges. A pixel is averaged with three
/// neighbours on each side, first along its row, then along its column; they must lie within five
/// sigma of the sensor's precision, and closer ones have more weight. Two opposite neighbours also
/// count when only their mean lies within, since a slanted surface is no edge. Invalid pixels stay
/// invalid. Columns are filtered only if the beams of rows overlap. Parallel; the same bytes on any
/// number of threads.
RayGrid smooth_depth(const RayGrid& grid, const RaySpacing& rays, const Precision& precision);

/// The same for a pinhole's picture.
ImageDepth smooth_depth(const ImageDepth& depth, const Precision& precision);

}  // namespace mr::fusion
