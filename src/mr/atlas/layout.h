#pragma once

#include <vector>

#include "mr/atlas/atlas_config.h"
#include "mr/core/result.h"
#include "mr/core/view.h"

namespace mr::atlas {

/// The positions of all views' tiles in one atlas picture.
struct Layout {
  int width = 0, height = 0;  ///< pixels, multiples of 16
  std::vector<View> views;    ///< with atlas_rect, stream 0 and `layout` set
};

/// Packs one tile per view in rows (shelf packing), each scaled by `scale`, or by less if they do
/// not fit into the largest atlas. too_large: not even the smallest tiles fit. Tiles start at
/// multiples of 16 pixels, so that no macroblock of the video mixes two views.
Result<Layout> make_layout(const std::vector<View>& views, const AtlasConfig& atlas, double scale,
                           std::uint32_t layout_id);

}  // namespace mr::atlas
