#pragma once

#include <map>
#include <vector>

#include "mr/atlas/view_observations.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/view.h"
#include "mr/node/root_colors.h"

namespace mr::node {

/// Paints the pictures that the root's atlases show: those of the cameras, and the plates, each
/// corrected (RootColors) and blended with the others on the surface that it textures
/// (atlas/view_blend). Keeps the depth of the still surface from the views.
class TexturePainter {
 public:
  using Used = std::map<ViewId, ImageMask>;

  /// The cameras' pictures, by stream, and the tiles of them that may give colour to others; a view
  /// without a mask gives all.
  struct Live {
    const std::vector<View>& views;
    const atlas::Pictures& pictures;
    std::map<ViewId, TileMask> seeing;
  };

  /// The live pictures, by stream, for a moving surface in front of a still one (null: none).
  /// `used`: pixels that it uses; a view without a mask is used whole. As they come where there is
  /// no moving surface.
  atlas::Pictures live(const Live& from, const Used& used, const Mesh& moving, const Mesh* still,
                       const RootColors& colors);
  /// The plates, by the stream of their view, for the still surface.
  atlas::Pictures plates(const std::vector<View>& views, const RootColors::Plates& plates,
                         const Used& used, const Mesh& still, const RootColors& colors);

 private:
  /// The still surface from a view.
  struct StillDepth {
    View view;
    ImageDepth depth;  ///< map (atlas::depth_camera)
  };

  void draw_still_depths(const Mesh& still, const std::vector<View>& views);

  Mesh still_;
  std::map<ViewId, StillDepth> still_depths_;  ///< of pinhole views
};

}  // namespace mr::node
