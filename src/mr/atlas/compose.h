#pragma once

#include <map>

#include "mr/atlas/color_gain.h"
#include "mr/atlas/layout.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"

namespace mr::atlas {

/// Pixels of a view's camera picture that a triangle labelled with it may show, with `margin_px`
/// around them. [height, width] of the view.
ImageMask used_pixels(const Mesh& mesh, const View& view, int margin_px);

/// Draws the atlas picture of a layout: every tile is resampled from where the child's view has it
/// (`children`: the same views by id, in their own streams; `pictures`: by stream), and brightened
/// by its gain (none: 1). Pixels of no use are black when `mask` is set (paper 3.3). Views that a
/// child lacks stay black.
ImageRgb compose_atlas(const Layout& layout, const std::map<ViewId, View>& children,
                       const Pictures& pictures, const std::map<ViewId, ImageMask>& used, bool mask,
                       const Gains& gains = {});

}  // namespace mr::atlas
