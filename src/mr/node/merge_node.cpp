#include "mr/node/merge_node.h"

#include <algorithm>
#include <utility>

#include "mr/atlas/labels.h"
#include "mr/core/parallel.h"
#include "mr/node/cube_merger.h"

namespace mr::node {
namespace {

constexpr std::size_t kMostReceipts = 64;

/// Whether two gatherings have the same geometry seen by the same views. A chunk that was kept is
/// the very same object.
bool same_geometry(const std::vector<DecodedScene>& a, const std::vector<DecodedScene>& b) {
  const auto same_source = [](const SourceInfo& p, const SourceInfo& q) {
    return p.sensor == q.sensor && p.T_world_depth == q.T_world_depth &&
           p.depth_camera == q.depth_camera;
  };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [&](const DecodedScene& x, const DecodedScene& y) {
                      return x.views == y.views && x.chunks == y.chunks &&
                             std::equal(x.sources.begin(), x.sources.end(), y.sources.begin(),
                                        y.sources.end(), same_source);
                    });
}

std::vector<kit::Part> parts_of(const std::vector<DecodedScene>& scenes, Layer layer) {
  std::vector<kit::Part> parts(scenes.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) parts[i] = part_of(scenes[i], layer);
  });
  return parts;
}

}  // namespace

MergeNode::MergeNode(const Scene& scene, const MergerConfig& merger, bool is_root, NodeClock clock,
                     StillWork still_work)
    : scene_(&scene),
      merger_(merger),
      is_root_(is_root),
      clock_(std::move(clock)),
      plan_(merger_plan(scene, is_root)),
      synchronizer_(scene, merger, !is_root),
      publisher_(scene, kMergedSource),
      atlas_(scene),
      calibration_(scene),
      joiner_(scene, merger_, clock_.now, trace_),
      still_merger_(scene, merger_, is_root, clock_.now, trace_),
      still_work_(still_work),
      empty_(overlap_config(scene)) {}

std::vector<std::byte> MergeNode::answer(const codec::Control& control) {
  if (control.plan) {
    CodingPlan plan = control.plan->root;
    if (!is_root_) plan.decimation = {};
    plan_.set(plan);
  }
  if (is_root_) {
    atlas_.answer(control);
  } else {
    const std::lock_guard lock(wishes_mutex_);
    if (key_frame_wishes_.size() < codec::Control::kMaxStreams)
      key_frame_wishes_.insert(control.key_frames.begin(), control.key_frames.end());
    for (; control.shown && !in_packets_.empty() && in_packets_.front().first <= *control.shown;
         in_packets_.pop_front())
      for (const auto& [input, sequence] : in_packets_.front().second) shown_[input] = sequence;
  }
  if (control.whole_head) writer_.ask_whole();
  return publisher_.answer(control.chunks);
}

std::vector<StreamId> MergeNode::take_key_frame_wishes() {
  const std::lock_guard lock(wishes_mutex_);
  std::vector<StreamId> out(key_frame_wishes_.begin(), key_frame_wishes_.end());
  key_frame_wishes_.clear();
  return out;
}

std::vector<std::pair<std::size_t, std::uint64_t>> MergeNode::take_shown() {
  const std::lock_guard lock(wishes_mutex_);
  std::vector<std::pair<std::size_t, std::uint64_t>> out(shown_.begin(), shown_.end());
  shown_.clear();
  return out;
}

Packet MergeNode::head(const CaptureSet& captures, const CodingPlan& plan) const {
  Packet packet;
  packet.scene = scene_->id, packet.node = id();
  packet.epoch = clock_.epoch, packet.sequence = sequence_;
  packet.captured_at = captures.tick;
  packet.sources = captures.sources;
  packet.plan = plan;
  return packet;
}

Result<std::vector<std::byte>> MergeNode::merge(const CaptureSet& captures,
                                                const std::function<void()>& halfway) {
  const TimePoint started = clock_.now ? clock_.now() : TimePoint{};
  const CodingPlan plan = plan_.get();
  Packet packet = head(captures, plan);
  if (const Status merged = merge_surfaces(captures, plan.decimation, halfway); !merged)
    return merged.error();
  const Status coded = trace_.time("encode_mesh", [&] {
    return publisher_.publish(moving_->mesh, moving_->error_m, plan.mesh_speed, packet);
  });
  if (!coded) return coded.error();
  if (const Status textured = add_textures(captures, packet); !textured) return textured.error();
  ++sequence_;
  add_marks(captures, started, packet);
  return writer_.write(std::move(packet));
}

std::optional<Mesh> MergeNode::surface() const {
  if (!moving_) return std::nullopt;
  Mesh out = moving_->mesh;
  if (still_.mesh) append(out, *still_.mesh);
  return out;
}

void MergeNode::add_marks(const CaptureSet& captures, TimePoint started, Packet& packet) const {
  if (!clock_.now) return;
  for (const auto& [stage, at] : captures.marks) packet.marks.push_back({stage, at});
  packet.marks.push_back({id() + "/gathered", started});
  packet.marks.push_back({id() + "/merged", clock_.now()});
}

/// The still surface where any of it changed, then the moving one.
Status MergeNode::merge_surfaces(const CaptureSet& captures, const Decimation& decimation,
                                 const std::function<void()>& halfway) {
  for (const auto& [input, sequence] : captures.taken) taken_[input] = sequence;
  if (auto made = still_job_.take())
    if (const Status shown = show(*std::move(made)); !shown) return shown;
  std::vector<DecodedScene> still, moving;
  bool any_still = false;
  for (const DecodedScene& scene : captures.scenes) {
    still.push_back(layer_of(scene, Layer::still));
    moving.push_back(layer_of(scene, Layer::moving));
    any_still |= !still.back().chunks.empty();
  }
  const bool still_changed =
      still_scenes_ ? !same_geometry(*still_scenes_, still) || still_decimation_ != decimation
                    : any_still;
  const bool moving_changed =
      !moving_ || moving_->decimation != decimation || !same_geometry(moving_->scenes, moving);
  reused_ = !still_changed && !moving_changed && !still_scenes_;
  if (reused_) return {};
  std::optional<StillMerger::Inputs> inputs;
  if (still_changed && !still_job_.is_busy()) {
    inputs = StillMerger::Inputs{still, parts_of(still, Layer::still)};
    still_scenes_ = std::move(still), still_decimation_ = decimation;
    correct(captures, true, inputs->parts);
  }
  Parts parts = parts_of(moving, Layer::moving);
  correct(captures, !still_scenes_, parts);
  if (still_scenes_) {
    look_at_plates(captures, parts);
    if (const Status brought = bring_still(std::move(inputs), decimation, parts); !brought)
      return brought;
  }
  if (still_.cover)
    trace_.time("cover", [&] {
      for (kit::Part& part : parts) part.mesh = still_.cover->uncovered(part);
    });
  return merge_moving(std::move(moving), parts, decimation, halfway);
}

/// Calibration; it is looked at where most surface is.
void MergeNode::correct(const CaptureSet& captures, bool look, Parts& parts) {
  trace_.time("register", [&] {
    places_ = {captures.views, captures.sources};
    if (look) calibration_.look(parts);
    calibration_.apply(parts);
    calibration_.apply(parts, places_.views, places_.sources);
  });
}

void MergeNode::look_at_plates(const CaptureSet& captures, const Parts& moving) {
  if (!is_root_) return;
  trace_.time("plates", [&] {
    Mesh all;
    for (const kit::Part& part : moving) append(all, part.mesh);
    atlas_.update_plates({captures, places_.views, places_.sources}, all);
  });
}

/// Brings the still surface up to date where an input changed (`inputs`), or labels should be
/// others: beside the ticks where that may be, and most is learnt. Then what moves goes on showing
/// what is not shown yet: the inputs wait for take_shown().
Status MergeNode::bring_still(std::optional<StillMerger::Inputs> inputs,
                              const Decimation& decimation, const Parts& moving) {
  if (is_root_ && !inputs && still_.mesh)
    emptied_m2_ += empty_.update(*still_.cover, places_.sources);
  if (still_job_.is_busy()) return {};
  const std::size_t blocks = atlas_.valid_blocks();
  if (!inputs && !still_merger_.is_due(sequence_, blocks, emptied_m2_)) return {};
  emptied_m2_ = 0;
  const auto told = inputs ? std::optional(taken_) : std::nullopt;
  auto job = [this, told,
              task = StillMerger::Task{sequence_, std::move(inputs), decimation, places_.views,
                                       places_.sources, atlas_.valid(), blocks, empty_}]() mutable {
    return StillMade{still_merger_.update(std::move(task)), told};
  };
  std::size_t moving_triangles = 0;
  for (const kit::Part& part : moving) moving_triangles += part.mesh.triangles.size();
  const bool is_learnt = still_.mesh && moving_triangles < still_.mesh->triangles.size() / 2;
  if (still_work_ == StillWork::at_once || !is_learnt) return show(job());
  still_job_.start(std::move(job));
  return {};
}

/// Takes what was made of the still surface, while no job is busy.
Status MergeNode::show(StillMade still) {
  if (!still.made) {
    still_scenes_.emplace();  // the inputs' are given again
    return still.made.error();
  }
  still_ = std::move(still.made->shown);
  if (is_root_) atlas_.bring_plates();
  still_merger_.note_outdated(
      publisher_.set_all_still(std::move(still.made->pieces), still_.error_m));
  if (still.inputs) untold_ = *std::move(still.inputs);
  if (untold_.empty() || !still.made->is_whole) return {};
  Sequences inputs = std::exchange(untold_, {});
  const std::lock_guard lock(wishes_mutex_);
  if (is_root_)
    for (const auto& [input, sequence] : inputs) shown_[input] = sequence;
  else
    in_packets_.emplace_back(sequence_, std::move(inputs));
  if (in_packets_.size() > kMostReceipts) in_packets_.pop_front();
  return {};
}

Status MergeNode::merge_moving(std::vector<DecodedScene> scenes, const Parts& parts,
                               const Decimation& decimation, const std::function<void()>& halfway) {
  Surface made{std::move(scenes), decimation, {}, 0};
  for (const kit::Part& part : parts) made.error_m = std::max(made.error_m, part.error_m);
  const auto small =
      joiner_.decimated(joiner_.join(parts, true, halfway), parts, decimation, made.error_m);
  if (!small) return small.error();
  auto mesh = on_lattice(
      trace_.time("atlas", [&] { return is_root_ ? label_moving(*small, made.error_m) : *small; }),
      *scene_);
  if (!mesh) return mesh.error();
  made.mesh = *std::move(mesh);
  moving_ = std::move(made);
  return {};
}

/// Only the root chooses views; others leave the sensors that measured it, which the next one asks
/// for.
Mesh MergeNode::label_moving(const Mesh& mesh, float error_m) const {
  atlas::LabelConfig config = label_config(*scene_, places_.sources, error_m);
  config.occluders = still_.occluders.get();
  return atlas::label_triangles(mesh, places_.views, config);
}

Status MergeNode::add_textures(const CaptureSet& captures, Packet& packet) {
  for (SourceInfo& source : packet.sources) {
    for (const SourceInfo& corrected : places_.sources)
      if (corrected.sensor == source.sensor) source.T_world_depth = corrected.T_world_depth;
    if (is_root_) source.confirmed_depth = source.confirmed_color = {};
  }
  if (is_root_ && !places_.views.empty()) {
    const RootAtlas::Tick tick{captures, places_.views, places_.sources};
    const Mesh* still = still_.mesh.get();
    const float error_m = std::max(moving_->error_m, still_.error_m);
    if (drawing_listener_) drawing_listener_({atlas_, tick, moving_->mesh, still, error_m});
    return trace_.time("encode_atlas",
                       [&] { return atlas_.compose(tick, moving_->mesh, still, error_m, packet); });
  }
  packet.views = places_.views;
  packet.textures = captures.units;
  return {};
}

}  // namespace mr::node
