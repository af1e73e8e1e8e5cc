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

/// Background pictures by view; not null. Those whose size differs from the children's are ignored.
using PicturesBehind = std::map<ViewId, const ImageRgb*>;

/// Composes the atlas picture of a layout. Every tile is resampled from the child's picture
/// (`children`: the same views by id, in their own streams; `pictures`: by stream) and multiplied
/// by its gain (missing: 1). Unused pixels are black if `mask` is set (paper 3.3), and so are views
/// that no child has. Where a view has a picture `behind`, 16x16 blocks of its tile without used
/// pixels show that, so that the video codec skips what does not move. `memory`: an image whose
/// memory is reused.
ImageRgb compose_atlas(const Layout& layout, const std::map<ViewId, View>& children,
                       const Pictures& pictures, const std::map<ViewId, ImageMask>& used, bool mask,
                       const Gains& gains = {}, const PicturesBehind& behind = {},
                       ImageRgb memory = {});

}  // namespace mr::atlas
