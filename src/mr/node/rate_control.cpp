#include "mr/node/rate_control.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "mr/node/chunk_publisher.h"
#include "mr/node/plans.h"
#include "mr/node/root_atlas.h"
#include "mr/rate/feature_space.h"
#include "mr/rate/grid.h"

namespace mr::node {

RateControl::RateControl(const Scene& scene, std::shared_ptr<const rate::Model> model)
    : scene_(&scene),
      controller_(std::move(model), scene.still.layers, scene.fps, scene.rate.target_mbps),
      target_mbps_(scene.rate.target_mbps),
      time_(std::max(rate::coarsest_error_voxels(scene.voxel_m) / 2, 1.0)) {
  controller_.set_coarsest_error(rate::coarsest_error_voxels(scene.voxel_m));
  controller_.set_lattice(-scene.lattice.step_exp);
  controller_.set_moving_weight(scene.rate.moving_weight);
}

/// Where nodes cannot keep up, there are fewer ticks than the scene's nominal rate.
void RateControl::note_pace(TimePoint tick) {
  constexpr std::size_t kFewest = 4;
  constexpr double kLikeNominal = 0.97;
  if (!ticks_.empty()) {
    const Duration usual =
        (ticks_.back() - ticks_.front()) / std::max<std::size_t>(ticks_.size() - 1, 1);
    const Duration pause = std::max<Duration>(std::chrono::milliseconds(500), 3 * usual);
    if (tick <= ticks_.back() || tick - ticks_.back() > pause) ticks_.clear();
  }
  ticks_.push_back(tick);
  while (ticks_.size() > kFewest && tick - ticks_.front() > std::chrono::seconds(1))
    ticks_.pop_front();
  if (ticks_.size() < kFewest) return;
  const double seconds = std::chrono::duration<double>(tick - ticks_.front()).count();
  const double fps = static_cast<double>(ticks_.size() - 1) / seconds;
  controller_.set_fps(fps > kLikeNominal * scene_->fps ? scene_->fps : fps);
}

void RateControl::note_features(const std::vector<FrameFeatures>& frames) {
  std::vector<rate::SensorFeatures> sensors;
  for (const FrameFeatures& frame : frames)
    if (const auto features = rate::features_of(frame.values))
      sensors.push_back({frame.has_color, *features});
  if (!sensors.empty()) controller_.set_features(rate::scene_features(sensors));
}

bool RateControl::begin(const CaptureSet& captures, const rate::Backlog& waiting, bool whole_head,
                        CodingPlan& root) {
  is_whole_head_ = whole_head;
  note_pace(captures.tick);
  note_features(captures.features);
  const double target = target_mbps_;
  controller_.set_target(std::isfinite(target) ? std::min(target, scene_->rate.target_mbps) : 0);
  planned_ = controller_.begin(waiting, head_bytes() - head_bytes_);
  if (planned_.skipped) controller_.sent({});
  root.decimation = moving_decimation(*scene_, planned_.setting.error_voxels);
  root.texture_scale = scene_->coding.texture_scale * planned_.setting.scale;
  return !planned_.skipped;
}

PlateLimits RateControl::plate_limits(bool may_refine) const {
  const double largest = controller_.largest_piece();
  return {{planned_.refinement, planned_.refinement >= largest}, largest, may_refine};
}

RateControl::Budget RateControl::code(double moving_bytes, double waiting, bool key_frame) {
  const rate::CaptureBudget budget =
      controller_.code({moving_bytes + head_bytes(), waiting, key_frame});
  return {budget.qp, {budget.refinement, budget.is_purse_full}};
}

void RateControl::sent(const Packet& packet, std::size_t bytes) {
  rate::CaptureBytes out;
  double head = static_cast<double>(bytes);
  double named = 0;
  for (const EncodedChunk& chunk : packet.chunks) {
    const bool is_still = chunk.key.id.layer == Layer::still;
    const auto size = static_cast<double>(chunk.payload.size());
    (is_still ? out.refinement : out.geometry) += size;
    head -= size;
    if (is_still) named += ChunkPublisher::kNameBytes;
  }
  for (const TextureUnit& unit : packet.textures) {
    const bool is_plate = unit.stream == RootAtlas::kPlateStream;
    const auto size = static_cast<double>(unit.data.size());
    (is_plate ? out.refinement : out.texture) += size;
    out.key_frame |= !is_plate && unit.key_frame;
    head -= size;
  }
  for (const AlphaPlane& alpha : packet.alpha) {
    out.texture += static_cast<double>(alpha.data.size());
    head -= static_cast<double>(alpha.data.size());
  }
  // What a head takes to name new still surface belongs to that. Heads tell changes again and again
  // until there is a new base, so the next one will take about as much as the rest.
  named = std::min(named, head);
  (is_whole_head_ ? whole_head_bytes_ : head_bytes_) = head - named;
  out.geometry += head - named, out.refinement += named;
  controller_.sent(out);
}

void RateControl::note_surface(const CaptureSet& captures, const Mesh& moving) {
  std::map<SensorId, rate::SensorShares::Triangles> triangles;
  // Who has no picture textures nothing, and may add surface all the same.
  for (const SourceInfo& source : captures.sources)
    for (const View& view : captures.views)
      if (view.id == view_of(source.sensor)) triangles[source.sensor];
  for (const DecodedScene& scene : captures.scenes)
    for (const auto& chunk : scene.chunks)
      if (chunk->key.id.layer == Layer::moving)
        for (const SensorRun& run : chunk->mesh.sensors)
          if (const auto sensor = triangles.find(run.id); sensor != triangles.end())
            sensor->second.delivered += run.count;
  for (auto& [sensor, counts] : triangles)
    for (const ViewRun& run : moving.views)
      if (run.id == view_of(sensor)) counts.shown += run.count;
  shares_.note(triangles);
}

void RateControl::note_time(const CaptureSet& captures, Duration own) {
  Duration slowest = own;
  const auto note = [&](const std::string& from, const std::string& to) {
    const auto first = captures.marks.find(from), last = captures.marks.find(to);
    if (first != captures.marks.end() && last != captures.marks.end())
      slowest = std::max(slowest, last->second - first->second);
  };
  note("sensors/reconstructed", "sensors/coded");
  for (const MergerConfig& merger : scene_->mergers)
    note(merger.id + "/gathered", merger.id + "/merged");
  time_.note(std::chrono::duration<double, std::milli>(slowest).count(),
             controller_.setting().error_voxels);
  controller_.set_least_error(time_.least_error_voxels());
}

std::optional<ScenePlan> RateControl::take_plan() {
  ScenePlan plan = scene_plan(*scene_, controller_.setting().error_voxels);
  const double coarsest_m = rate::coarsest_error_m(scene_->voxel_m);
  for (const SensorId id : all_sensors(scene_->sensors))
    if (const double coarser = shares_.coarser(id); coarser > 1) {
      CodingPlan of_sensor = plan.of(id);
      double& error_m = of_sensor.decimation.error_m;
      error_m = std::max(error_m, std::min(error_m * coarser, coarsest_m));
      plan.by_sensor[id] = of_sensor;
    }
  if (passed_ == plan) return std::nullopt;
  passed_ = plan;
  return plan;
}

}  // namespace mr::node
