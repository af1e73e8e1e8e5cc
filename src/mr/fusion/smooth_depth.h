#pragma once

#include "mr/core/image.h"
#include "mr/core/packet.h"

namespace mr::fusion {

/// Averages every valid pixel with its neighbours (7 x 7) that lie within five sigma of it, closer
/// ones counting more: sensor noise and quantisation go, depth edges stay (bilateral filter, as in
/// Newcombe et al. 2011, with the sensor's own precision as its range). Invalid pixels stay
/// invalid. Parallel; the same bytes on any number of threads.
ImageDepth smooth_depth(const ImageDepth& depth, const Precision& precision);

}  // namespace mr::fusion
