#include "mr/node/still_layer.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "mr/node/surface_joiner.h"

namespace mr::node {
StillLayer::StillLayer(const Scene& scene, const MergerConfig& merger, bool is_root, Clock clock,
                       StillWork work, Trace& trace, ChunkPublisher& publisher, RootAtlas& atlas)
    : is_root_(is_root),
      piece_m_(StillMerger::piece_m(scene, is_root)),
      work_(work),
      publisher_(&publisher),
      atlas_(&atlas),
      merger_(scene, merger, is_root, std::move(clock), trace),
      receipts_(is_root),
      carver_(overlap_config(scene)) {}

bool StillLayer::is_outdated(const std::vector<DecodedScene>& scenes,
                             const Decimation& decimation) const {
  if (scenes_) return !same_geometry(*scenes_, scenes) || decimation_ != decimation;
  return std::ranges::any_of(scenes, [](const DecodedScene& s) { return !s.chunks.empty(); });
}

Status StillLayer::publish_finished(std::uint64_t sequence) {
  std::optional<Update> update = job_.take();
  return update ? publish(*std::move(update), sequence) : Status{};
}

std::optional<StillMerger::Inputs> StillLayer::take_inputs(std::vector<DecodedScene> scenes,
                                                           const Decimation& decimation) {
  if (job_.is_busy()) return std::nullopt;
  StillMerger::Inputs inputs{scenes, parts_of(scenes), {}};
  scenes_ = std::move(scenes), decimation_ = decimation;
  return inputs;
}

/// Beside the ticks only when most is learnt: until then viewers wait for the still surface.
bool StillLayer::is_mostly_learnt(std::size_t moving_triangles) const {
  return shown_.mesh && moving_triangles < shown_.mesh->triangles.size() / 2;
}

Status StillLayer::update(std::optional<StillMerger::Inputs> inputs, const Tick& tick) {
  if (is_root_ && !inputs && shown_.mesh)
    carved_m2_ += carver_.update(*shown_.cover, tick.poses.sources);
  if (job_.is_busy()) return {};
  const std::size_t blocks = atlas_->valid_blocks();
  if (!inputs && !merger_.is_due(tick.sequence, blocks, carved_m2_)) return {};
  carved_m2_ = 0;
  const auto packets = inputs ? std::optional(receipts_.taken()) : std::nullopt;
  StillMerger::Task task{tick.sequence,
                         std::move(inputs),
                         tick.decimation,
                         tick.poses.views,
                         tick.poses.sources,
                         atlas_->valid(),
                         blocks,
                         atlas_->plate_colors(tick.poses.views),
                         carver_};
  auto job = [this, packets, task = std::move(task)]() mutable {
    return Update{merger_.update(std::move(task)), packets};
  };
  if (work_ == StillWork::at_once || !is_mostly_learnt(tick.moving_triangles))
    return publish(job(), tick.sequence);
  job_.start(std::move(job));
  return {};
}

Status StillLayer::publish(Update update, std::uint64_t sequence) {
  if (!update.made) {
    scenes_.emplace();  // so that the inputs are merged again
    return update.made.error();
  }
  StillMerger::Made& made = *update.made;
  shown_ = std::move(made.shown);
  if (is_root_) atlas_->bring_plates();
  merger_.note_outdated(publisher_->set_all_still(std::move(made.pieces)));
  receipts_.publish(std::move(update.inputs), made.is_whole, sequence);
  return {};
}

void StillLayer::remove_shown(std::vector<kit::Part>& moving) const {
  if (!shown_.cover) return;
  const std::set<Vec3i> waiting = publisher_->waiting_still();
  for (kit::Part& part : moving) {
    if (waiting.empty()) {
      part.mesh = shown_.cover->uncovered(part);
      continue;
    }
    std::vector<std::uint8_t> stays(part.mesh.triangles.size()), rest(stays.size());
    for (std::size_t t = 0; t < stays.size(); ++t) {
      stays[t] = waiting.contains(cube_of(vec_cast<double>(part.mesh.centroid(t)), piece_m_));
      rest[t] = !stays[t];
    }
    Mesh kept = select_triangles(part.mesh, stays);
    part.mesh = select_triangles(part.mesh, rest);
    part.mesh = shown_.cover->uncovered(part);
    append(part.mesh, kept);
  }
}

}  // namespace mr::node
