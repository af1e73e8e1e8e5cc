#include "mr/baseline/single_views.h"

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
  const Mesh* const meshes[] = {&grid->mesh};
  const kit::RayScene surface(meshes);
  const kit::RayScene* const hiding[] = {&surface};
  const Photographed in{&grid->mesh, grid->views, grid->pictures, hiding};
  const std::vector<int> label = cut_views(grid->mesh, grid->views.size(), gradient_sums(in));
  std::vector<ImageRgb> levelled;
  if (are_levelled) levelled = levelled_pictures(in, label);
  Chunk chunk;
  chunk.mesh = grid->mesh;
  std::vector<ViewId> ids;
  for (const int l : label)
    ids.push_back(l < 0 ? kNoView : grid->views[static_cast<std::size_t>(l)].id);
  set_triangle_views(chunk.mesh, ids);
  DecodedScene out = grid->shown(std::move(chunk));
  out.views = grid->views;
  for (std::size_t v = 0; v < out.views.size(); ++v)
    out.textures[out.views[v].stream] = std::make_shared<const ImageRgb>(
        are_levelled ? std::move(levelled[v]) : *grid->pictures[v]);
  return out;
}

}  // namespace mr::baseline
