#include "mr/node/layers.h"

#include <algorithm>
#include <cstdint>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"

namespace mr::node {

std::map<ViewId, TileMask> seeing_tiles(const std::vector<View>& views,
                                        const std::vector<SourceInfo>& sources) {
  std::map<ViewId, TileMask> out;
  for (const SourceInfo& source : sources) {
    const auto view = std::ranges::find(views, view_of(source.sensor), &View::id);
    if (view == views.end() || !source.blind_color.is_of(view->width, view->height)) continue;
    TileMask& seeing = out[view->id] = source.blind_color;
    for (std::uint8_t& tile : seeing.tiles) tile = tile == 0;
  }
  return out;
}

DecodedScene layer_of(const DecodedScene& scene, Layer layer) {
  DecodedScene out;
  out.captured_at = scene.captured_at;
  out.sources = scene.sources, out.views = scene.views;
  for (const auto& chunk : scene.chunks)
    if (chunk->key.id.layer == layer) out.chunks.push_back(chunk);
  return out;
}

std::vector<DecodedScene> layer_of(const std::vector<DecodedScene>& scenes, Layer layer) {
  std::vector<DecodedScene> out;
  for (const DecodedScene& scene : scenes) out.push_back(layer_of(scene, layer));
  return out;
}

kit::Part part_of(const DecodedScene& scene, const std::function<bool(Vec3i)>& wanted) {
  kit::Part part;
  for (const auto& chunk : scene.chunks) {
    if (!wanted(chunk->key.id.cube)) continue;
    append(part.mesh, chunk->mesh);
    part.error_m = std::max(part.error_m, chunk->error_m);
  }
  if (!part.mesh.views.empty()) clear_labels(part.mesh);  // inputs have no say in texturing
  part.mesh = kit::weld(part.mesh);
  part.sources = scene.sources;
  return part;
}

std::vector<kit::Part> parts_of(const std::vector<DecodedScene>& scenes) {
  std::vector<kit::Part> parts(scenes.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      parts[i] = part_of(scenes[i], [](Vec3i) { return true; });
  });
  return parts;
}

CubeErrors errors_of(const std::vector<DecodedScene>& scenes) {
  CubeErrors out;
  for (const DecodedScene& scene : scenes)
    for (const auto& chunk : scene.chunks) out.raise(chunk->key.id.cube, chunk->error_m);
  return out;
}

bool same_place(const SourceInfo& a, const SourceInfo& b) {
  return a.sensor == b.sensor && a.T_world_depth == b.T_world_depth &&
         a.depth_camera == b.depth_camera;
}

bool same_geometry(const std::vector<DecodedScene>& a, const std::vector<DecodedScene>& b) {
  return std::ranges::equal(a, b, [](const DecodedScene& x, const DecodedScene& y) {
    return x.views == y.views && x.chunks == y.chunks &&
           std::ranges::equal(x.sources, y.sources, same_place);
  });
}

}  // namespace mr::node
