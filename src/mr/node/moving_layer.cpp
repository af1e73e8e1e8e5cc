#include "mr/node/moving_layer.h"

#include <utility>

#include "mr/atlas/labels.h"
#include "mr/node/still_merger.h"

namespace mr::node {

bool MovingLayer::is_outdated(const std::vector<DecodedScene>& scenes,
                              const Decimation& decimation) const {
  return !merged_ || merged_->decimation != decimation || !same_geometry(merged_->scenes, scenes);
}

Status MovingLayer::update(std::vector<DecodedScene> scenes, const std::vector<kit::Part>& parts,
                           const Tick& tick) {
  auto surface = joiner_.decimated(joiner_.join(parts, true, tick.on_cores_free), parts,
                                   errors_of(scenes), tick.decimation);
  if (!surface) return surface.error();
  if (is_root_) joiner_.close_holes(parts, Layer::moving, *surface);
  // Only the root chooses views; below it labels stay the sensors that measured.
  auto mesh = trace_->time("atlas", [&] {
    if (!is_root_) return surface->mesh;
    atlas::LabelConfig config = label_config(*scene_, tick.poses.sources, surface->errors.most_m());
    config.valid = seeing_tiles(tick.poses.views, tick.poses.sources);
    config.alpha = tick.alpha;
    config.occluders = tick.still, config.colors = tick.colors, config.history = &history_;
    Mesh labelled = atlas::label_triangles(surface->mesh, tick.poses.views, config);
    history_ = atlas::LabelHistory(labelled);
    return labelled;
  });
  merged_ = Merged{std::move(scenes), tick.decimation, std::move(mesh), std::move(surface->errors),
                   std::move(surface->guessed)};
  return {};
}

}  // namespace mr::node
