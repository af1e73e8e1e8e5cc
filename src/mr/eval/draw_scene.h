#pragma once

#include "mr/core/decoded_scene.h"
#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/render/renderer.h"

namespace mr::eval {

/// A picture and where it shows something: 1 where a surface is.
struct RenderedView {
  ImageRgb color;
  ImageMask covered;
};

/// A scene as a client shows it (EVALUATION, "Render"): unlit, back faces left out, mid-grey where
/// nothing is.
Result<RenderedView> draw_scene(render::Renderer& renderer, const DecodedScene& scene,
                                const render::Viewpoint& view);

}  // namespace mr::eval
