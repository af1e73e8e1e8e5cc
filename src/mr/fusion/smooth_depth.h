#pragma once

#include "mr/fusion/ray_grid.h"

namespace mr::fusion {

/// Averages every valid pixel with its neighbours, three on each side along its row and then along
/// its column, that lie within five sigma of it, closer ones counting more: sensor noise and
/// quantisation go, depth edges stay (bilateral filter, as in Newcombe et al. 2011, with the
/// sensor's own precision as its range, in two passes). Two opposite neighbours count also where
/// only their mean lies within: a slanted surface is no edge. Invalid pixels stay invalid. Rows are
/// averaged only where their beams share light. Parallel; the same bytes on any number of threads.
RayGrid smooth_depth(const RayGrid& grid, const RaySpacing& rays, const Precision& precision);

/// The same of an ordinary picture.
ImageDepth smooth_depth(const ImageDepth& depth, const Precision& precision);

}  // namespace mr::fusion
