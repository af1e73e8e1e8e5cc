#include "mr/node/moving_layer.h"

#include <algorithm>
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
  Merged merged{std::move(scenes), tick.decimation, {}, 0};
  for (const kit::Part& part : parts) merged.error_m = std::max(merged.error_m, part.error_m);
  const auto small = joiner_.decimated(joiner_.join(parts, true, tick.on_cores_free), parts,
                                       tick.decimation, merged.error_m);
  if (!small) return small.error();
  // Only the root chooses views; below it labels stay the sensors that measured.
  auto mesh = trace_->time("atlas", [&] {
    if (!is_root_) return *small;
    atlas::LabelConfig config = label_config(*scene_, tick.poses.sources, merged.error_m);
    config.occluders = tick.still;
    return atlas::label_triangles(*small, tick.poses.views, config);
  });
  auto snapped = on_lattice(mesh, *scene_);
  if (!snapped) return snapped.error();
  merged.mesh = *std::move(snapped);
  merged_ = std::move(merged);
  return {};
}

}  // namespace mr::node
