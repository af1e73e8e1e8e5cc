#pragma once

#include "mr/core/decoded_scene.h"
#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/render/renderer.h"

namespace mr::eval {

/// A rendered picture and its coverage mask: 1 where a surface is visible.
struct RenderedView {
  ImageRgb color;
  ImageMask covered;
};

/// Renders a scene as a client does: unlit, with back-face culling, on a
/// mid-grey background.
Result<RenderedView> draw_scene(render::Renderer& renderer, const DecodedScene& scene,
                                const render::Viewpoint& view);

}  // namespace mr::eval
