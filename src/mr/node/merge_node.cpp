#include "mr/node/merge_node.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "mr/atlas/burn.h"
#include "mr/atlas/compose.h"
#include "mr/atlas/labels.h"
#include "mr/codec/mesh_codec.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/overlap.h"
#include "mr/merge/zipper.h"
#include "mr/node/sensor_node.h"

namespace mr::node {
namespace {

constexpr std::uint32_t kAtlasStream = 0;
constexpr double kReach_voxels = 48;  // three cells of the quality grid

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

}  // namespace

MergeNode::MergeNode(const Scene& scene, const MergerConfig& merger, bool is_root, NodeClock clock)
    : scene_(&scene),
      merger_(merger),
      is_root_(is_root),
      clock_(std::move(clock)),
      gatherer_(scene, merger, !is_root),
      publisher_(scene, kMergedSource),
      texture_(scene, kAtlasStream),
      calibration_(scene),
      cubes_(scene.fusion.chunk_m, kReach_voxels * scene.voxel_m) {}

std::vector<std::byte> MergeNode::answer(const codec::Request& request) {
  if (is_root_ && request.wants_key_frame(kAtlasStream)) texture_.ask_key_frame();
  if (!is_root_) {
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
  reused_ = last_ && same_geometry(last_->first.scenes, gathered.scenes);
  if (!reused_) {
    auto surface = merge_surfaces(gathered, halfway);
    if (!surface) return surface.error();
    Gathered seen;
    seen.scenes = gathered.scenes;
    for (DecodedScene& scene : seen.scenes) scene.textures.clear();
    last_.emplace(std::move(seen), *std::move(surface));
  }
  const Surface& surface = last_->second;
  const Status coded = trace_.time("encode_mesh", [&] {
    return publisher_.publish(surface.mesh, surface.error_m, packet.plan.mesh_speed, packet);
  });
  if (!coded) return coded.error();
  if (const Status textured = add_textures(gathered, surface, packet); !textured)
    return textured.error();
  ++sequence_;
  add_marks(gathered, started, packet);
  return writer_.write(std::move(packet));
}

void MergeNode::add_marks(const Gathered& gathered, TimePoint started, Packet& packet) const {
  if (!clock_.now) return;
  for (const auto& [stage, at] : gathered.marks) packet.marks.push_back({stage, at});
  packet.marks.push_back({id() + "/gathered", started});
  packet.marks.push_back({id() + "/merged", clock_.now()});
}

Result<MergeNode::Surface> MergeNode::merge_surfaces(const Gathered& gathered,
                                                     const std::function<void()>& halfway) {
  std::vector<merge::Part> parts(gathered.scenes.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) parts[i] = part_of(gathered.scenes[i]);
  });
  Surface out{{}, 0, gathered.views, gathered.sources};
  for (const merge::Part& part : parts) out.error_m = std::max(out.error_m, part.error_m);
  trace_.time("register", [&] { calibration_.run(parts, out.views, out.sources); });

  const auto join_some = [&](const std::vector<merge::Part>& some, bool all) {
    return join(some, all, halfway);
  };
  // Corrections of poses (merge.refine) concern all that an input has.
  const bool whole = scene_->merge.refine || scene_->merge.leave_out_mm > 0;
  const Mesh joined =
      whole ? join(parts, true, halfway) : cubes_.run(gathered.scenes, parts, join_some);
  if (std::exchange(hurried_, false)) cubes_.forget();  // seams are open
  const auto small = trace_.time("simplify", [&] { return decimated(joined, out.error_m); });
  if (!small) return small.error();
  const Mesh labelled = trace_.time("atlas", [&] {
    if (!is_root_) return *small;  // with the sensors that measured it, which the next one asks for
    return atlas::label_triangles(*small, out.views,
                                  {.views = scene_->atlas.views,
                                   .geometry_error_m = texturing_error_m(*scene_, out.error_m),
                                   .precision = noisiest(out.sources),
                                   .min_edge_m = 2 * scene_->voxel_m});
  });
  auto snapped = codec::snap_to_lattice(labelled, scene_->lattice);
  if (!snapped) return snapped.error();
  out.mesh = kit::without_nonmanifold_edges(*snapped);
  return out;
}

/// Paper 3.2: one surface of all parts, which may be pieces.
Mesh MergeNode::join(const std::vector<merge::Part>& parts, bool all,
                     const std::function<void()>& halfway) {
  const double voxel_m = scene_->voxel_m;
  const MergeConfig& config = scene_->merge;
  const auto started = std::chrono::steady_clock::now();
  const auto spent_ms = [&] {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - started)
        .count();
  };
  quality_.freeze(!all);
  const std::vector<Mesh> owned = trace_.time("overlap", [&] {
    return merge::remove_overlap(parts,
                                 {.owner = config.owner,
                                  .overlap = config.overlap,
                                  .voxel_m = voxel_m,
                                  .calibration_error_m = config.calibration_error_m},
                                 &quality_);
  });
  if (all) triangles_ = triangles_sent(parts, owned);
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
Result<Mesh> MergeNode::decimated(const Mesh& mesh, float& error_m) {
  auto snapped = codec::snap_to_lattice(mesh, scene_->lattice);
  if (!snapped || !is_root_ || scene_->merge.simplify.ratio >= 1) return snapped;
  const double target = scene_->merge.simplify.ratio * triangles_;
  const auto small =
      simplifier_.run(*snapped, {.triangles = static_cast<std::size_t>(std::ceil(target))});
  if (!small) return small.error();
  error_m += small->error_m;
  return codec::snap_to_lattice(small->mesh, scene_->lattice);
}

Status MergeNode::add_textures(const Gathered& gathered, const Surface& surface, Packet& packet) {
  for (SourceInfo& source : packet.sources)
    for (const SourceInfo& corrected : surface.sources)
      if (corrected.sensor == source.sensor) source.T_world_depth = corrected.T_world_depth;
  if (is_root_ && !surface.views.empty()) return compose_atlas(gathered, surface, packet);
  packet.views = surface.views;
  packet.textures = gathered.units;
  return {};
}

Status MergeNode::compose_atlas(const Gathered& gathered, const Surface& surface, Packet& packet) {
  const std::uint32_t current = layout_.views.empty() ? 0 : layout_.views.front().layout;
  auto made =
      atlas::make_layout(surface.views, scene_->atlas, scene_->coding.texture_scale, current);
  if (!made) return made.error();
  atlas::Layout wanted = *std::move(made);
  const auto same_tiles = [](const View& a, const View& b) {
    return a.id == b.id && a.atlas_rect == b.atlas_rect;
  };
  if (!std::equal(wanted.views.begin(), wanted.views.end(), layout_.views.begin(),
                  layout_.views.end(), same_tiles))
    for (View& view : wanted.views) view.layout = current + 1;
  layout_ = std::move(wanted);
  packet.views = layout_.views;

  auto unit = trace_.time("encode_atlas", [&] {
    std::map<ViewId, View> children;
    std::map<ViewId, ImageMask> used;
    std::map<std::uint32_t, std::shared_ptr<const ImageRgb>> pictures;
    for (const DecodedScene& scene : gathered.scenes)
      pictures.insert(scene.textures.begin(), scene.textures.end());
    for (const View& view : surface.views) {
      children[view.id] = view;
      if (!scene_->atlas.mask) continue;
      const double margin =
          atlas::margin_px(view, texturing_error_m(*scene_, surface.error_m), 1.0);
      used[view.id] = atlas::used_pixels(surface.mesh, view, static_cast<int>(std::ceil(margin)));
    }
    if (scene_->merge.color_gain) balance_.update(surface.mesh, surface.views, pictures);
    ImageRgb picture = atlas::compose_atlas(layout_, children, pictures, used, scene_->atlas.mask,
                                            balance_.gains());
    if (scene_->atlas.burn_sequence) atlas::burn_number(picture, packet.sequence);
    return texture_.encode(picture, packet.plan.texture_qp, layout_.views.front().layout);
  });
  if (!unit) return unit.error();
  packet.textures.push_back(*std::move(unit));
  return {};
}

}  // namespace mr::node
