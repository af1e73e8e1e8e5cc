#include "mr/eval/draw.h"

#include <algorithm>

namespace mr::eval {

Result<Drawn> draw_scene(render::Renderer& renderer, const DecodedScene& scene,
                         const render::Viewpoint& view) {
  render::RenderOptions options;
  options.cull_back_faces = true;
  auto color = renderer.draw(scene, view.camera, view.T_world_camera, options);
  if (!color) return color.error();
  options.background = {127, 128, 128};  // only what is not covered changes
  const auto other = renderer.draw(scene, view.camera, view.T_world_camera, options);
  if (!other) return other.error();
  Drawn drawn{*std::move(color), ImageMask(view.camera.width, view.camera.height)};
  for (std::size_t i = 0; i < drawn.covered.data.size(); ++i)
    drawn.covered.data[i] = drawn.color.data[3 * i] == other->data[3 * i] ? 1 : 0;
  return drawn;
}

}  // namespace mr::eval
