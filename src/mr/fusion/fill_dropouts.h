#pragma once

#include "mr/core/image.h"
#include "mr/core/packet.h"

namespace mr::fusion {

/// Fills depth pixels that failed, as many do on dark or grazing surfaces, where two opposite
/// neighbours lie on one surface: by their mean, twice over, so that holes of up to two pixels
/// close and nothing grows past an edge. Parallel over rows.
ImageDepth fill_dropouts(const ImageDepth& depth, const Precision& precision);

}  // namespace mr::fusion
