#pragma once

#include <map>
#include <memory>
#include <optional>

#include "mr/atlas/layout.h"
#include "mr/atlas/view_observations.h"
#include "mr/core/decoded_scene.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"

namespace mr::atlas {

/// Pixels of a view's camera picture that a triangle labelled with it may show, with `margin_px`
/// around them. [height, width] of the view.
ImageMask used_pixels(const Mesh& mesh, const View& view, int margin_px);

/// Background pictures by view; not null. Those whose size differs from the children's are ignored.
using PicturesBehind = std::map<ViewId, const ImageRgb*>;

/// What an atlas is composed of.
struct AtlasSources {
  /// The views as the children have them, by id, each in its own stream; pictures by stream, with
  /// the colours that are to be shown.
  const std::map<ViewId, View>& children;
  const Pictures& pictures;
  std::map<ViewId, ImageMask> used{};  ///< used_pixels(); a view without a mask is used whole
  bool mask = false;                   ///< unused pixels are black (paper 3.3)
  PicturesBehind behind{};
};

/// Composes the atlas picture of a layout. Every tile is resampled from the child's picture.
/// Views that no child has are black. Where a view has a picture `behind`, 16x16 blocks
/// of its tile without used pixels show that, so that the video codec skips what does not move.
/// `memory`: an image whose memory is reused.
ImageRgb compose_atlas(const Layout& layout, const AtlasSources& from, ImageRgb memory = {});

/// What an alpha plane is composed of.
struct AlphaSources {
  const std::map<ViewId, View>& children;  ///< as AtlasSources has them
  const AlphaByStream& planes;
  /// Pixels that a view's triangles show. Blocks of 8x8 of the plane whose used pixels are all 0 or
  /// all 1 become that, so that outlines that nobody sees cost no bits. Without a mask: all.
  const std::map<ViewId, ImageMask>& used;
};

/// The alpha plane of the atlas picture of a layout, nearest pixels of the children's planes; 1
/// where there is none. Nothing: it would be 1 everywhere.
std::optional<Alpha> compose_alpha(const Layout& layout, const AlphaSources& from);

}  // namespace mr::atlas
