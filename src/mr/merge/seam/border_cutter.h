#pragma once

#include "mr/merge/seam/border.h"
#include "mr/merge/seam/border_map.h"
#include "mr/merge/seam/zipper.h"

namespace mr::merge {

/// Splits border edges that are longer than 1.5 · config.edge_m and near another part's border at
/// their midpoints, recursively, together with their triangles. Keeps joined.border sorted.
void split_long_border_edges(Joined& joined, const BorderMap& map, const ZipperConfig& config);

}  // namespace mr::merge
