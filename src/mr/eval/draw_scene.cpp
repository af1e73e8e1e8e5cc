#include "mr/eval/draw_scene.h"

namespace mr::eval {

Result<RenderedView> draw_scene(render::Renderer& renderer, const DecodedScene& scene,
                                const render::Viewpoint& view) {
  render::RenderOptions options;
  options.cull_back_faces = true;
  auto color = renderer.draw(scene, view.camera, view.T_world_camera, options);
  if (!color) return color.error();
  return RenderedView{*std::move(color), renderer.covered()};
}

}  // namespace mr::eval
