#include "mr/node/merge_node.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "mr/atlas/labels.h"
#include "mr/codec/mesh_codec.h"
#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/overlap.h"
#include "mr/merge/zipper.h"
#include "mr/node/sensor_node.h"

namespace mr::node {
namespace {

constexpr double kReach_voxels = 48;  // three cells of the quality grid

// Ticks: how long a fresh still triangle without a plate waits for one (less than the ten captures
// in which the moving surface shows it, too); how long still surface without a plate waits for one;
// and how long at most those that have one wait for a better.
constexpr std::uint64_t kPatience = 8, kRelabelEvery = 30, kLabelAllEvery = 3000;
// The same where hardly any more have come; one block in so many is not hardly any.
constexpr std::uint64_t kRelabelLateEvery = 300;
constexpr std::size_t kManyBlocks = 100;
// The root sends the still surface in cubes that divide the chunk grid's: a change reaches fewer
// triangles.
constexpr int kStillPerCube = 2;
// Ticks between removals of what was carried away, where that is much, or little.
constexpr std::uint64_t kEmptyEvery = 15, kLittleEvery = 30;
constexpr double kMuchEmptied_m2 = 0.02;
constexpr double kWorthWithholding_m2 = 0.02;
constexpr double kManyCuts = 1.3;  // times as many triangles as when all was labelled

/// How many triangles the children spent on the surface that stays. Cutting along overlaps adds
/// many small ones; decimation counts from here.
double triangles_sent(const std::vector<merge::Part>& parts, const std::vector<Mesh>& owned) {
  double sum = 0;
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (!parts[i].mesh.empty())
      sum += static_cast<double>(parts[i].mesh.triangles.size()) * surface_area_m2(owned[i]) /
             surface_area_m2(parts[i].mesh);
  return sum;
}

/// The precision of the noisiest of several sensors, as seen from 2 m.
Precision noisiest(const std::vector<SourceInfo>& sources) {
  const auto worst = std::max_element(sources.begin(), sources.end(),
                                      [](const SourceInfo& a, const SourceInfo& b) {
                                        return a.precision.sigma_m(2) < b.precision.sigma_m(2);
                                      });
  return worst == sources.end() ? Precision{} : worst->precision;
}

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

std::vector<merge::Part> parts_of(const std::vector<DecodedScene>& scenes, Layer layer) {
  std::vector<merge::Part> parts(scenes.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) parts[i] = part_of(scenes[i], layer);
  });
  return parts;
}

float largest_error_m(const std::vector<merge::Part>& parts) {
  float most = 0;
  for (const merge::Part& part : parts) most = std::max(most, part.error_m);
  return most;
}

}  // namespace

MergeNode::MergeNode(const Scene& scene, const MergerConfig& merger, bool is_root, NodeClock clock)
    : scene_(&scene),
      merger_(merger),
      is_root_(is_root),
      clock_(std::move(clock)),
      gatherer_(scene, merger, !is_root),
      publisher_(scene, kMergedSource),
      atlas_(scene),
      calibration_(scene),
      cubes_(scene.fusion.chunk_m, kReach_voxels * scene.voxel_m),
      empty_(overlap_config()) {}

merge::OverlapConfig MergeNode::overlap_config() const {
  return {.owner = scene_->merge.owner,
          .overlap = scene_->merge.overlap,
          .voxel_m = scene_->voxel_m,
          .calibration_error_m = scene_->merge.calibration_error_m};
}

std::vector<std::byte> MergeNode::answer(const codec::Request& request) {
  if (is_root_) {
    atlas_.answer(request);
  } else {
    const std::lock_guard lock(wishes_mutex_);
    if (key_frame_wishes_.size() < codec::Request::kMaxStreams)
      key_frame_wishes_.insert(request.key_frames.begin(), request.key_frames.end());
  }
  if (request.whole_head) writer_.ask_whole();
  return publisher_.answer(request.chunks);
}

std::vector<std::uint32_t> MergeNode::take_key_frame_wishes() {
  const std::lock_guard lock(wishes_mutex_);
  std::vector<std::uint32_t> out(key_frame_wishes_.begin(), key_frame_wishes_.end());
  key_frame_wishes_.clear();
  return out;
}

Packet MergeNode::head(const Gathered& gathered) const {
  Packet packet;
  packet.scene = scene_->id, packet.node = id();
  packet.epoch = clock_.epoch, packet.sequence = sequence_;
  packet.captured_at = gathered.tick;
  packet.sources = gathered.sources;
  packet.plan = {is_root_ ? static_cast<float>(scene_->merge.simplify.ratio) : 1.0f, 5,
                 static_cast<float>(scene_->coding.texture_scale), scene_->coding.texture_qp};
  return packet;
}

Result<std::vector<std::byte>> MergeNode::merge(const Gathered& gathered,
                                                const std::function<void()>& halfway) {
  const TimePoint started = clock_.now ? clock_.now() : TimePoint{};
  Packet packet = head(gathered);
  if (const Status merged = merge_surfaces(gathered, halfway); !merged) return merged.error();
  const Status coded = trace_.time("encode_mesh", [&] {
    return publisher_.publish(moving_->mesh, moving_->error_m, packet.plan.mesh_speed, packet);
  });
  if (!coded) return coded.error();
  if (const Status textured = add_textures(gathered, packet); !textured) return textured.error();
  ++sequence_;
  add_marks(gathered, started, packet);
  return writer_.write(std::move(packet));
}

std::optional<Mesh> MergeNode::surface() const {
  if (!moving_) return std::nullopt;
  Mesh out = moving_->mesh;
  if (still_) append(out, still_->mesh);
  return out;
}

void MergeNode::add_marks(const Gathered& gathered, TimePoint started, Packet& packet) const {
  if (!clock_.now) return;
  for (const auto& [stage, at] : gathered.marks) packet.marks.push_back({stage, at});
  packet.marks.push_back({id() + "/gathered", started});
  packet.marks.push_back({id() + "/merged", clock_.now()});
}

/// The still surface where any of it changed, then the moving one.
Status MergeNode::merge_surfaces(const Gathered& gathered, const std::function<void()>& halfway) {
  std::vector<DecodedScene> still, moving;
  bool any_still = false;
  for (const DecodedScene& scene : gathered.scenes) {
    still.push_back(layer_of(scene, Layer::still));
    moving.push_back(layer_of(scene, Layer::moving));
    any_still |= !still.back().chunks.empty();
  }
  const bool still_changed = still_ ? !same_geometry(still_->scenes, still) : any_still;
  const bool moving_changed = !moving_ || !same_geometry(moving_->scenes, moving);
  reused_ = !still_changed && !moving_changed && !still_;
  if (reused_) return {};
  if (still_changed)
    if (const Status merged = merge_still(gathered, std::move(still)); !merged) return merged;
  Parts parts = parts_of(moving, Layer::moving);
  correct(gathered, !still_, parts);
  if (still_) {
    look_at_plates(gathered, parts);
    if (is_root_ && still_->is_labelled)
      still_->emptied_m2 += empty_.update(still_->cover, gathered.sources);
    if (const Status labelled = label_still(); !labelled) return labelled;
    trace_.time("cover", [&] {
      for (merge::Part& part : parts) part.mesh = still_->cover.uncovered(part);
    });
  }
  return merge_moving(std::move(moving), parts, halfway);
}

/// Calibration; it is looked at where most surface is.
void MergeNode::correct(const Gathered& gathered, bool look, Parts& parts) {
  trace_.time("register", [&] {
    places_ = {gathered.views, gathered.sources};
    if (look) calibration_.look(parts);
    calibration_.apply(parts);
    calibration_.apply(parts, places_.views, places_.sources);
  });
}

/// One still surface of all inputs'. It is labelled later.
Status MergeNode::merge_still(const Gathered& gathered, std::vector<DecodedScene> scenes) {
  Parts parts = parts_of(scenes, Layer::still);
  correct(gathered, true, parts);
  const auto join_some = [&](const Parts& some, bool all) {
    return join(some, all, still_joining_, {});
  };
  // Corrections of poses (merge.refine) concern all that an input has.
  const bool whole = scene_->merge.refine || scene_->merge.leave_out_mm > 0;
  const Mesh joined = whole ? join_some(parts, true) : cubes_.run(scenes, parts, join_some);
  if (std::exchange(hurried_, false)) cubes_.forget();  // seams are open
  note_fresh(scenes);
  Still made;
  made.scenes = std::move(scenes), made.error_m = largest_error_m(parts);
  auto small =
      trace_.time("simplify", [&] { return decimated(joined, still_joining_, made.error_m); });
  if (!small) return small.error();
  made.joined = *std::move(small), made.parts = std::move(parts);
  if (still_) made.mesh = std::move(still_->mesh);  // what is shown until it is labelled
  still_ = std::move(made);
  return {};
}

void MergeNode::look_at_plates(const Gathered& gathered, const Parts& moving) {
  if (!is_root_) return;
  trace_.time("plates", [&] {
    Mesh all;
    for (const merge::Part& part : moving) append(all, part.mesh);
    atlas_.update_plates({gathered, places_.views, places_.sources}, all);
  });
}

/// Notes which cubes of the still surface are fresh. Another change does not prolong that: what
/// came before it is not sent as moving for longer.
void MergeNode::note_fresh(const std::vector<DecodedScene>& scenes) {
  std::map<Vec3i, std::vector<ChunkKey>> contents;
  for (const DecodedScene& scene : scenes)
    for (const auto& chunk : scene.chunks) contents[chunk->key.id.cube].push_back(chunk->key);
  for (const auto& [cube, keys] : contents) {
    const auto before = still_contents_.find(cube);
    const bool changed = before == still_contents_.end() || before->second != keys;
    const auto since = fresh_since_.find(cube);
    if (changed && (since == fresh_since_.end() || sequence_ > since->second + kPatience))
      fresh_since_[cube] = sequence_;
  }
  still_contents_ = std::move(contents);
}

/// Until which tick a cube of the still surface is fresh; nothing: it is not.
std::optional<std::uint64_t> MergeNode::fresh_until(Vec3i cube) const {
  const auto since = fresh_since_.find(cube);
  if (since == fresh_since_.end() || sequence_ >= since->second + kPatience) return std::nullopt;
  return since->second + kPatience;
}

/// Without triangles that have no plate, where they are fresh and nothing was shown before: until
/// they have, or it is plain that nobody sees their colour, they stay with the moving surface.
Mesh MergeNode::without_fresh_grey(const Mesh& mesh, const Mesh& shown,
                                   std::optional<std::uint64_t>& until) const {
  std::vector<std::uint8_t> keep(mesh.triangles.size(), 1);
  std::optional<kit::RayScene> before;
  double withheld_m2 = 0;
  for (const ViewRun& run : mesh.runs) {
    if (run.view != kNoView) continue;
    for (std::uint32_t t = run.first; t < run.first + run.count; ++t) {
      const Vec3f p = mesh.centroid(t);
      const auto fresh = fresh_until(cube_of(vec_cast<double>(p), scene_->fusion.chunk_m));
      if (!fresh) continue;
      const Mesh* const meshes[] = {&shown};
      if (!before) before.emplace(meshes);
      if (before->nearest(p, static_cast<float>(2 * scene_->voxel_m))) continue;
      keep[t] = 0, withheld_m2 += 0.5 * length(mesh.area_normal(t));
      until = std::min(until.value_or(*fresh), *fresh);
    }
  }
  if (withheld_m2 < kWorthWithholding_m2) until.reset();
  return until ? select_triangles(mesh, keep) : mesh;
}

/// The still surface with the plates that texture it: chosen where something changed, and at times,
/// the longer it is there the more seldom, everywhere, as there are more plates to choose from.
Mesh MergeNode::labelled_still() {
  Still& still = *still_;
  const std::size_t blocks = atlas_.valid_blocks();
  const std::uint64_t wait = std::clamp(labels_.all - labels_.first, kPatience, kLabelAllEvery);
  // What was before another thing for a while leaves its cuts.
  const bool many_cuts =
      static_cast<double>(labels_.pieces) > kManyCuts * static_cast<double>(labels_.pieces_at_all);
  const bool all = !labels_.are_any || ((blocks > labels_.blocks_at_all || many_cuts) &&
                                        sequence_ >= labels_.all + wait);
  if (!std::exchange(labels_.are_any, true)) labels_.first = sequence_;
  labels_.last = sequence_, labels_.blocks = blocks;
  atlas::LabelConfig config = label_config(still.error_m);
  config.valid = atlas_.valid();
  Mesh out = labels_.lasting.update(empty_.without_empty(still.joined), places_.views,
                                    std::move(config), all);
  labels_.pieces = out.triangles.size();
  if (all)
    labels_.all = sequence_, labels_.blocks_at_all = blocks, labels_.pieces_at_all = labels_.pieces;
  return out;
}

/// Whether there are enough more blocks of plates than when the still surface was labelled last, or
/// any, after a while; then labels that were not sent count, too.
bool MergeNode::is_labelling_worth_it(std::uint64_t age) const {
  if (labels_.are_outdated && age >= kRelabelLateEvery) return true;
  const std::size_t blocks = atlas_.valid_blocks();
  return blocks > labels_.blocks &&
         (age >= kRelabelLateEvery || kManyBlocks * (blocks - labels_.blocks) >= blocks);
}

/// Labels the still surface when it is new, and when there are more plates to choose from.
Status MergeNode::label_still() {
  Still& still = *still_;
  const std::uint64_t age = sequence_ - labels_.last;
  const std::uint64_t empty_every =
      still.emptied_m2 >= kMuchEmptied_m2 ? kEmptyEvery : kLittleEvery;
  const bool due = !still.is_labelled || (still.emptied_m2 > 0 && age >= empty_every) ||
                   (still.withheld_until && sequence_ >= *still.withheld_until) ||
                   (is_root_ && age >= kRelabelEvery && is_labelling_worth_it(age));
  if (!due) return {};
  const Mesh labelled =
      trace_.time("atlas", [&] { return is_root_ ? labelled_still() : still.joined; });
  const bool was_whole = !still.withheld_until.has_value();
  still.withheld_until.reset(), still.emptied_m2 = 0;
  const bool withhold = is_root_ && !places_.views.empty();
  auto mesh = on_lattice(withhold ? without_fresh_grey(labelled, still.mesh, still.withheld_until)
                                  : labelled);
  if (!mesh) return mesh.error();
  still.mesh = *std::move(mesh);
  if (is_root_) atlas_.bring_plates();
  const bool is_whole = !still.withheld_until.has_value();
  if (!still.is_labelled || !was_whole || !is_whole || !labels_.lasting.kept_surface())
    still.cover = merge::StillCover(still.mesh, still.parts, overlap_config());
  still.is_labelled = true;
  const double cube_m = scene_->fusion.chunk_m;
  labels_.are_outdated = publisher_.set_all_still(still.mesh, still.error_m,
                                                  is_root_ ? cube_m / kStillPerCube : cube_m);
  return {};
}

Status MergeNode::merge_moving(std::vector<DecodedScene> scenes, const Parts& parts,
                               const std::function<void()>& halfway) {
  Surface made{std::move(scenes), {}, largest_error_m(parts)};
  const Mesh joined = join(parts, true, moving_joining_, halfway);
  auto small =
      trace_.time("simplify", [&] { return decimated(joined, moving_joining_, made.error_m); });
  if (!small) return small.error();
  auto mesh = on_lattice(
      trace_.time("atlas", [&] { return is_root_ ? label_moving(*small, made.error_m) : *small; }));
  if (!mesh) return mesh.error();
  made.mesh = *std::move(mesh);
  moving_ = std::move(made);
  return {};
}

atlas::LabelConfig MergeNode::label_config(float error_m) const {
  return {.views = scene_->atlas.views,
          .geometry_error_m = texturing_error_m(*scene_, error_m),
          .precision = noisiest(places_.sources),
          .min_edge_m = 2 * scene_->voxel_m};
}

/// Only the root chooses views; others leave the sensors that measured it, which the next one asks
/// for.
Mesh MergeNode::label_moving(const Mesh& mesh, float error_m) const {
  atlas::LabelConfig config = label_config(error_m);
  if (still_) config.occluders = &labels_.lasting.occluders();
  return atlas::label_triangles(mesh, places_.views, config);
}

Result<Mesh> MergeNode::on_lattice(const Mesh& mesh) const {
  auto snapped = codec::snap_to_lattice(mesh, scene_->lattice);
  if (!snapped) return snapped.error();
  return kit::without_nonmanifold_edges(*snapped);
}

/// Paper 3.2: one surface of all parts, which may be pieces.
Mesh MergeNode::join(const Parts& parts, bool all, Joining& joining,
                     const std::function<void()>& halfway) {
  const double voxel_m = scene_->voxel_m;
  const MergeConfig& config = scene_->merge;
  const auto started = std::chrono::steady_clock::now();
  const auto spent_ms = [&] {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - started)
        .count();
  };
  joining.quality.freeze(!all);
  const std::vector<Mesh> owned = trace_.time(
      "overlap", [&] { return merge::remove_overlap(parts, overlap_config(), &joining.quality); });
  if (all) joining.triangles = triangles_sent(parts, owned);
  if (halfway) halfway();
  const Mesh zipped = trace_.time("zipper", [&] {
    merge::ZipperConfig zipper = merge::zipper_config(voxel_m);
    if (config.gap_m > 0) zipper.max_gap_m = config.gap_m;
    const double before_ms = spent_ms();
    const bool hurry = merger_.budget_ms > 0 && before_ms + zipper_ms_ > merger_.budget_ms;
    hurried_ |= hurry;
    if (hurry) zipper.max_gap_m = 0;
    Mesh out = merge::zip(owned, zipper);
    if (!hurry) zipper_ms_ = spent_ms() - before_ms;
    return out;
  });
  const Mesh whole = trace_.time("islands", [&] {
    return merge::remove_islands(
        zipped, config.island_area_m2 > 0 ? config.island_area_m2 : merge::island_area_m2(voxel_m));
  });
  return merger_.region ? inside(whole, *merger_.region, scene_->fusion.chunk_m) : whole;
}

/// On the lattice. Only the root decimates, and only where the scene asks for it.
Result<Mesh> MergeNode::decimated(const Mesh& mesh, const Joining& joining, float& error_m) {
  auto snapped = codec::snap_to_lattice(mesh, scene_->lattice);
  if (!snapped || !is_root_ || scene_->merge.simplify.ratio >= 1) return snapped;
  const double target = scene_->merge.simplify.ratio * joining.triangles;
  const auto small =
      simplifier_.run(*snapped, {.triangles = static_cast<std::size_t>(std::ceil(target))});
  if (!small) return small.error();
  error_m += small->error_m;
  return codec::snap_to_lattice(small->mesh, scene_->lattice);
}

Status MergeNode::add_textures(const Gathered& gathered, Packet& packet) {
  for (SourceInfo& source : packet.sources) {
    for (const SourceInfo& corrected : places_.sources)
      if (corrected.sensor == source.sensor) source.T_world_depth = corrected.T_world_depth;
    if (is_root_) source.confirmed_depth = source.confirmed_color = {};
  }
  if (is_root_ && !places_.views.empty()) {
    const RootAtlas::Tick tick{gathered, places_.views, places_.sources};
    const Mesh* still = still_ ? &still_->mesh : nullptr;
    const float error_m = std::max(moving_->error_m, still_ ? still_->error_m : 0.0f);
    if (drawing_listener_) drawing_listener_({atlas_, tick, moving_->mesh, still, error_m});
    return trace_.time("encode_atlas",
                       [&] { return atlas_.compose(tick, moving_->mesh, still, error_m, packet); });
  }
  packet.views = places_.views;
  packet.textures = gathered.units;
  return {};
}

}  // namespace mr::node
