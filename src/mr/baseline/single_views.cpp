#include "mr/baseline/single_views.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "mr/baseline/photographed_grid.h"
#include "mr/baseline/waechter.h"

namespace mr::baseline {

Result<DecodedScene> single_view_scene(const Scene& scene, std::span<const Frame> capture,
                                       bool are_levelled) {
  auto grid = PhotographedGrid::of(scene, capture);
  if (!grid) return grid.error();
  const auto is_panorama = [](const View& view) { return view.kind != View::Kind::pinhole; };
  if (std::ranges::any_of(grid->views, is_panorama))
    return Error{Error::Cause::unsupported,
                 "scene '" + scene.id + "': single views of panoramas are not supported"};
  const Mesh* const meshes[] = {&grid->mesh};
  const kit::RayScene surface(meshes);
  const kit::RayScene* const hiding[] = {&surface};
  const Photographed in{&grid->mesh, grid->views, grid->pictures, hiding};
  const std::vector<int> label = cut_views(grid->mesh, grid->views.size(), gradient_sums(in));
  std::vector<ImageRgb> pictures;
  if (are_levelled)
    pictures = levelled_pictures(in, label);
  else
    for (const ImageRgb* picture : grid->pictures) pictures.push_back(*picture);
  Chunk chunk;
  chunk.mesh = std::move(grid->mesh);
  std::vector<ViewId> ids;
  for (const int l : label)
    ids.push_back(l < 0 ? kNoView : grid->views[static_cast<std::size_t>(l)].id);
  set_triangle_views(chunk.mesh, ids);
  DecodedScene out = grid->shown(std::move(chunk));
  out.views = grid->views;
  for (std::size_t v = 0; v < out.views.size(); ++v)
    out.textures[out.views[v].stream] = std::make_shared<const ImageRgb>(std::move(pictures[v]));
  return out;
}

}  // namespace mr::baseline
