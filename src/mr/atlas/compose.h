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

/// Pictures by view; not null. Those of another size than the children's count for nothing.
using PicturesBehind = std::map<ViewId, const ImageRgb*>;

/// Draws the atlas picture of a layout: every tile is resampled from where the child's view has it
/// (`children`: the same views by id, in their own streams; `pictures`: by stream), and brightened
/// by its gain (none: 1). Pixels of no use are black when `mask` is set (paper 3.3). Views that a
/// child lacks stay black. A view that has a picture `behind` shows it in every 16x16 block of its
/// tile without used pixels, so that a video of the atlas skips what does not move. `memory`: of a
/// picture that is not needed any more, to be used again.
ImageRgb compose_atlas(const Layout& layout, const std::map<ViewId, View>& children,
                       const Pictures& pictures, const std::map<ViewId, ImageMask>& used, bool mask,
                       const Gains& gains = {}, const PicturesBehind& behind = {},
                       ImageRgb memory = {});

}  // namespace mr::atlas
