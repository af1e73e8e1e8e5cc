#include "mr/baseline/photographed_grid.h"

#include <algorithm>
#include <utility>

#include "mr/baseline/cameras.h"
#include "mr/baseline/monolithic.h"

namespace mr::baseline {

Result<PhotographedGrid> PhotographedGrid::of(const Scene& scene, std::span<const Frame> capture) {
  PhotographedGrid out;
  out.views = color_views(scene, capture);
  if (out.views.empty())
    return Error{Error::Cause::empty, "scene '" + scene.id + "' has no colour"};
  out.mesh = fuse_all(scene, capture, scene.voxel_m);
  if (out.mesh.empty())
    return Error{Error::Cause::empty, "scene '" + scene.id + "': a capture holds no surface"};
  for (const View& view : out.views)
    out.pictures.push_back(&frame_of(capture, sensor_of(view.id)).color);
  for (const Frame& frame : capture)
    out.captured_at = std::max(out.captured_at, frame.captured_at());
  return out;
}

DecodedScene PhotographedGrid::shown(Chunk chunk) const {
  DecodedScene out;
  out.captured_at = captured_at;
  out.chunks = {std::make_shared<const Chunk>(std::move(chunk))};
  return out;
}

}  // namespace mr::baseline
