#include "mr/node/merge_node.h"

#include <algorithm>
#include <utility>

namespace mr::node {
MergeNode::MergeNode(const Scene& scene, const MergerConfig& merger, bool is_root, NodeClock clock,
                     StillWork still_work)
    : scene_(&scene),
      merger_(merger),
      is_root_(is_root),
      clock_(std::move(clock)),
      plan_(merger_plan(scene, is_root)),
      still_decimation_(plan_.get().decimation),
      synchronizer_(scene, merger, !is_root),
      calibration_(scene),
      publisher_(scene, kMergedSource),
      atlas_(scene),
      moving_(scene, merger_, is_root, clock_.now, trace_),
      still_(scene, merger_, is_root, clock_.now, still_work, trace_, publisher_, atlas_) {}

std::vector<std::byte> MergeNode::answer(const codec::Control& control) {
  if (control.target_mbps && rate_) rate_->set_target(*control.target_mbps);
  if (control.plan) {
    CodingPlan plan = control.plan->root;
    if (!is_root_) plan.decimation = {};
    plan_.set(plan);
  }
  if (is_root_) {
    atlas_.answer(control);
  } else {
    if (control.shown && *control.shown < sequence_)  // else of another epoch
      still_.receipts().acknowledge(*control.shown);
    const std::lock_guard lock(key_frames_mutex_);
    if (key_frames_wanted_.size() < codec::Control::kMaxStreams)
      key_frames_wanted_.insert(control.key_frames.begin(), control.key_frames.end());
  }
  if (control.whole_head) writer_.ask_whole();
  return publisher_.answer(control.chunks);
}

std::vector<StreamId> MergeNode::take_wanted_key_frames() {
  const std::lock_guard lock(key_frames_mutex_);
  const std::set<StreamId> wanted = std::exchange(key_frames_wanted_, {});
  return {wanted.begin(), wanted.end()};
}

Packet MergeNode::head(const CaptureSet& captures, const CodingPlan& plan) const {
  Packet packet;
  packet.scene = scene_->id, packet.node = id();
  packet.epoch = clock_.epoch, packet.sequence = sequence_;
  packet.captured_at = captures.tick;
  packet.sources = captures.sources;
  packet.plan = plan;
  if (!is_root_) packet.features = captures.features;
  return packet;
}

Result<std::vector<std::byte>> MergeNode::merge(const CaptureSet& captures,
                                                const std::function<void()>& on_cores_free) {
  const TimePoint started = clock_.now ? clock_.now() : TimePoint{};
  CodingPlan plan = plan_.get();
  const bool is_left_out =
      rate_ && !rate_->begin(captures, backlog(), writer_.is_base_due(sequence_), plan);
  // The room is learnt all the same.
  if (const Status updated = update_layers(captures, plan.decimation, on_cores_free); !updated) {
    if (rate_ && !is_left_out) rate_->give_up();
    return updated.error();
  }
  if (is_left_out)
    return Error{Error::Cause::over_budget, "a tick left out: the target is below what it takes"};
  auto bytes = send(captures, plan, started);
  if (!rate_) return bytes;
  if (!bytes) rate_->give_up();
  rate_->note_surface(captures, moving_.mesh());
  const bool is_usual = sequence_ > 1;  // the first one makes the whole still surface
  if (clock_.now && is_usual) rate_->note_time(captures, clock_.now() - started);
  return bytes;
}

/// The packet of the surfaces as they are now.
Result<std::vector<std::byte>> MergeNode::send(const CaptureSet& captures, const CodingPlan& plan,
                                               TimePoint started) {
  Packet packet = head(captures, plan);
  add_sources(packet);
  if (const Status coded = code(captures, packet); !coded) return coded.error();
  still_.receipts().release(publisher_.sent_until());
  ++sequence_;
  add_marks(captures, started, packet);
  if (!rate_) return writer_.write(std::move(packet));
  auto bytes = writer_.write(packet);
  rate_->sent(packet, bytes.size());
  return bytes;
}

/// Still surface and plates.
rate::Backlog MergeNode::backlog() const {
  rate::Backlog out{.still_bytes = publisher_.waiting_bytes(),
                    .missing_bytes = publisher_.missing_bytes()};
  if (poses_.views.empty()) return out;
  const RootAtlas::Waiting& plates = atlas_.waiting();
  out.plate_bytes = plates.bytes, out.plate_qp = plates.qp, out.best_plate_qp = plates.best_qp;
  return out;
}

/// Mesh and pictures. What moves is coded first: the rest gets what that leaves.
Status MergeNode::code(const CaptureSet& captures, Packet& packet) {
  const auto moving_bytes = trace_.time("encode_mesh", [&] {
    if (std::exchange(is_moving_new_, false))
      publisher_.set_moving(moving_.mesh(), moving_.errors(), moving_.guessed());
    return publisher_.code_moving(packet.plan.mesh_speed);
  });
  if (!moving_bytes) return moving_bytes.error();
  auto drawn = draw(captures, packet);
  if (!drawn) return drawn.error();
  const bool is_drawn = drawn->has_value();
  Allowance of_still;
  if (rate_) {
    const bool key_frame = is_drawn && atlas_.needs_key_frame(**drawn);
    const RateControl::Budget budget =
        rate_->code(static_cast<double>(*moving_bytes), backlog().bytes(), key_frame);
    packet.plan.texture_qp = budget.texture_qp, of_still = budget.refinement;
  }
  if (const Status coded = code_pictures(captures, *std::move(drawn), packet); !coded) return coded;
  for (const TextureUnit& unit : packet.textures)
    if (is_root_ && unit.stream == RootAtlas::kPlateStream)
      of_still = {of_still.bytes - static_cast<double>(unit.data.size()), false};
  if (is_drawn && atlas_.are_plates_held()) of_still = {0, false};
  return trace_.time("publish",
                     [&] { return publisher_.publish(packet.plan.mesh_speed, packet, of_still); });
}

std::optional<Mesh> MergeNode::surface() const {
  if (!moving_.exists()) return std::nullopt;
  Mesh out = moving_.mesh();
  if (const auto& still = still_.shown().mesh) append(out, *still);
  return out;
}

void MergeNode::add_marks(const CaptureSet& captures, TimePoint started, Packet& packet) const {
  if (!clock_.now) return;
  for (const auto& [stage, at] : captures.marks) packet.marks.push_back({stage, at});
  packet.marks.push_back({id() + "/gathered", started});
  packet.marks.push_back({id() + "/merged", clock_.now()});
}

/// The still surface where any of it changed, then the moving one without what the still one shows.
Status MergeNode::update_layers(const CaptureSet& captures, const Decimation& decimation,
                                const std::function<void()>& on_cores_free) {
  still_.receipts().note_taken(captures.taken);
  if (const Status published = still_.publish_finished(sequence_); !published) return published;

  auto still = layer_of(captures.scenes, Layer::still);
  auto moving = layer_of(captures.scenes, Layer::moving);
  const bool is_still_outdated = still_.is_outdated(still, still_decimation_);
  reused_ = !still_.exists() && !is_still_outdated && !moving_.is_outdated(moving, decimation);
  if (reused_) return {};

  // Unchanged inputs, too, are merged anew where their corrections go on.
  std::optional<StillMerger::Inputs> inputs;
  if (is_still_outdated || (still_.exists() && calibration_.is_due(sequence_)))
    inputs = still_.take_inputs(std::move(still), still_decimation_);
  if (inputs) {
    const bool changed = correct_poses(captures, true, inputs->parts);
    inputs->bends = calibration_.bends(inputs->parts);
    if (!is_still_outdated && !changed) inputs.reset();
  }
  std::vector<kit::Part> parts = parts_of(moving);
  correct_poses(captures, !still_.exists(), parts);
  if (still_.exists()) {
    update_plates(captures, parts);
    const StillLayer::Tick tick{sequence_, still_decimation_, poses_, kit::triangles_of(parts)};
    const auto cover = [&] { trace_.time("cover", [&] { still_.remove_shown(parts); }); };
    // Where rate is controlled, still surface of this tick may wait: what moves there stays until
    // it was sent.
    if (rate_) cover();
    if (const Status updated = still_.update(std::move(inputs), tick); !updated) return updated;
    if (!rate_) cover();
  }
  const atlas::PictureSampler colors = atlas_.live_colors(captures);
  const Status updated = moving_.update(std::move(moving), parts,
                                        {decimation, poses_, still_.shown().occluders.get(),
                                         &colors, alpha_of(captures), on_cores_free});
  is_moving_new_ |= updated.ok();
  return updated;
}

/// Calibration is measured on the layer that has most surface. Whether corrections changed.
bool MergeNode::correct_poses(const CaptureSet& captures, bool measure,
                              std::vector<kit::Part>& parts) {
  return trace_.time("register", [&] {
    poses_ = {captures.views, captures.sources};
    const bool changed = measure && calibration_.update(parts, sequence_);
    calibration_.apply(parts);
    calibration_.apply(parts, poses_.views, poses_.sources);
    return changed;
  });
}

void MergeNode::update_plates(const CaptureSet& captures, const std::vector<kit::Part>& moving) {
  if (!is_root_) return;
  trace_.time("plates", [&] {
    Mesh all;
    for (const kit::Part& part : moving) append(all, part.mesh);
    atlas_.update_plates({captures, poses_.views, poses_.sources}, all);
  });
}

void MergeNode::add_sources(Packet& packet) const {
  for (SourceInfo& source : packet.sources) {
    for (const SourceInfo& corrected : poses_.sources)
      if (corrected.sensor == source.sensor) source.T_world_depth = corrected.T_world_depth;
    if (is_root_) source.confirmed_depth = source.confirmed_color = source.blind_color = {};
  }
}

/// The root's pictures; nothing below it.
Result<std::optional<RootAtlas::Drawn>> MergeNode::draw(const CaptureSet& captures,
                                                        const Packet& packet) {
  using Drawn = std::optional<RootAtlas::Drawn>;
  if (!is_root_ || poses_.views.empty()) return Drawn();
  const RootAtlas::Tick tick{captures, poses_.views, poses_.sources};
  const Mesh* still = still_.shown().mesh.get();
  const float error_m = std::max(moving_.errors().most_m(), still_.shown().error_m);
  if (drawing_listener_) drawing_listener_({atlas_, tick, moving_.mesh(), still, error_m});
  return trace_.time("draw_atlas", [&]() -> Result<Drawn> {
    const PlateLimits limits =
        rate_ ? rate_->plate_limits(publisher_.waiting_bytes() <= 0) : PlateLimits{};
    auto drawn =
        atlas_.draw(tick, moving_.mesh(), still, error_m, packet.plan, packet.sequence, limits);
    if (!drawn) return drawn.error();
    return Drawn(*std::move(drawn));
  });
}

Status MergeNode::code_pictures(const CaptureSet& captures, std::optional<RootAtlas::Drawn> drawn,
                                Packet& packet) {
  if (drawn)
    return trace_.time("encode_atlas", [&] { return atlas_.encode(*std::move(drawn), packet); });
  packet.views = poses_.views;
  packet.textures = captures.units, packet.alpha = captures.alpha;
  return {};
}

}  // namespace mr::node
