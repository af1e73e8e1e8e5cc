#include "mr/node/merge_node.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "mr/atlas/compose.h"
#include "mr/atlas/labels.h"
#include "mr/codec/mesh_codec.h"
#include "mr/codec/packet_codec.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/overlap.h"
#include "mr/merge/zipper.h"
#include "mr/node/sensor_node.h"
#include "mr/simplify/simplify.h"

namespace mr::node {
namespace {

constexpr std::uint32_t kAtlasStream = 0;

Duration milliseconds(double ms) {
  return std::chrono::round<Duration>(std::chrono::duration<double, std::milli>(ms));
}

/// The whole surface of a scene; borders between chunks are welded.
merge::Part part_of(const DecodedScene& scene) {
  merge::Part part;
  for (const auto& chunk : scene.chunks) {
    append(part.mesh, chunk->mesh);
    part.error_m = std::max(part.error_m, chunk->error_m);
  }
  part.mesh = kit::weld(part.mesh);
  part.sources = scene.sources;
  return part;
}

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

/// The sensors in the subtree of a node.
std::set<std::uint32_t> sensors_below(const Scene& scene, const std::string& node) {
  std::set<std::uint32_t> out;
  for (std::uint32_t i = 0; i < scene.sensors.size(); ++i)
    if (scene.sensors[i].id == node) out.insert(i);
  for (const MergerConfig& merger : scene.mergers)
    if (merger.id == node)
      for (const std::string& input : merger.inputs) out.merge(sensors_below(scene, input));
  return out;
}

/// Whether two gatherings have the same geometry seen by the same views.
bool same_geometry(const std::vector<DecodedScene>& a, const std::vector<DecodedScene>& b) {
  const auto key = [](const DecodedScene& s) {
    std::vector<ChunkKey> keys;
    for (const auto& chunk : s.chunks) keys.push_back(chunk->key);
    return keys;
  };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [&](const DecodedScene& x, const DecodedScene& y) {
                      const auto same_source = [](const SourceInfo& p, const SourceInfo& q) {
                        return p.sensor == q.sensor && p.T_world_depth == q.T_world_depth &&
                               p.depth_camera == q.depth_camera;
                      };
                      return x.views == y.views && key(x) == key(y) &&
                             std::equal(x.sources.begin(), x.sources.end(), y.sources.begin(),
                                        y.sources.end(), same_source);
                    });
}

}  // namespace

MergeNode::MergeNode(const Scene& scene, const MergerConfig& merger, bool is_root,
                     Upstream upstream)
    : scene_(&scene),
      merger_(merger),
      is_root_(is_root),
      upstream_(std::move(upstream)),
      aligner_(merger.inputs.size(), milliseconds(1000 / scene.fps),
               milliseconds(merger.deadline_ms)),
      publisher_(scene, kMergedSource),
      texture_(scene, kAtlasStream) {
  for (const std::string& input : merger.inputs)
    inputs_.push_back({input, sensors_below(scene, input), codec::Receiver(scene.lattice), {}});
}

void MergeNode::ask_key_frame() {
  if (is_root_) return texture_.ask_key_frame();
  for (std::size_t i = 0; i < inputs_.size() && upstream_.key_frame; ++i) upstream_.key_frame(i);
}

/// The packet must come from the node that the input stands for, and speak for its sensors only:
/// another's ids would collide with those of other inputs.
Status MergeNode::check_sender(const Input& input, const Packet& packet) const {
  const auto refuse = [](const std::string& why) { return Error{Error::Cause::invalid, why}; };
  if (packet.scene != scene_->id || packet.node != input.id)
    return refuse("is of node '" + packet.node + "' of scene '" + packet.scene + "'");
  for (const View& view : packet.views)
    if (!input.sensors.contains(view.id))
      return refuse("brings view " + std::to_string(view.id) + ", which is not below it");
  for (const SourceInfo& source : packet.sources)
    if (!input.sensors.contains(source.sensor))
      return refuse("brings sensor " + std::to_string(source.sensor) + ", which is not below it");
  if (packet.sources.empty()) return refuse("names no sensor");
  if (input.receiver.is_stale(packet)) return refuse("comes after a newer one");
  return {};
}

Status MergeNode::receive(std::size_t input, std::span<const std::byte> bytes, TimePoint now) {
  const auto start = std::chrono::steady_clock::now();
  Input& from = inputs_[input];
  const std::string link = from.id + " → " + id();
  const auto refuse = [&](const Error& error) {
    const Error told{error.cause,
                     "packet from '" + from.id + "' to '" + id() + "': " + error.message};
    drops_.count(link, told);
    return told;
  };
  auto packet = codec::decode_packet(bytes);
  if (!packet) return refuse(packet.error());
  if (const Status fits = check_sender(from, *packet); !fits) return refuse(fits.error());

  for (const Error& error : from.receiver.accept(*packet)) drops_.count(link, error);
  for (const ChunkKey& key : from.receiver.missing())
    if (const auto chunk = upstream_.chunk ? upstream_.chunk(input, key) : nullptr)
      if (const Status taken = from.receiver.provide(*chunk); !taken)
        drops_.count(link, taken.error());
  if (!from.receiver.streams_waiting().empty() && upstream_.key_frame) upstream_.key_frame(input);
  if (!is_root_)
    std::move(packet->textures.begin(), packet->textures.end(), std::back_inserter(from.units));
  aligner_.arrived(input, packet->captured_at, now);
  decode_ms_ +=
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return {};
}

/// Units that could not be handed on are lost; whoever waits for them needs key frames.
void MergeNode::give_up_units() {
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    if (inputs_[i].units.empty()) continue;
    inputs_[i].units.clear();
    if (upstream_.key_frame) upstream_.key_frame(i);
  }
}

Result<std::optional<std::vector<std::byte>>> MergeNode::merge(TimePoint now) {
  const auto tick = aligner_.ready(now);
  if (!tick) return std::optional<std::vector<std::byte>>();
  aligner_.merged(*tick, now);
  auto merged = merge_tick(*tick);
  if (!merged) {
    give_up_units();
    return merged.error();
  }
  return std::optional(*std::move(merged));
}

Result<std::vector<std::byte>> MergeNode::merge_tick(TimePoint tick) {
  auto gathered = gather(tick);
  if (!gathered) return gathered.error();

  Packet packet;
  packet.scene = scene_->id, packet.node = id(), packet.sequence = sequence_,
  packet.captured_at = tick;
  packet.sources = gathered->sources;
  packet.plan = {is_root_ ? static_cast<float>(scene_->merge.simplify.ratio) : 1.0f, 5,
                 static_cast<float>(scene_->coding.texture_scale), scene_->coding.texture_qp};

  reused_ = last_ && same_geometry(last_->first.scenes, gathered->scenes);
  if (!reused_) {
    auto surface = merge_surfaces(*gathered);
    if (!surface) return surface.error();
    last_.emplace(Gathered{gathered->scenes, {}, {}}, *std::move(surface));
  }
  const Surface& surface = last_->second;
  const Status coded = trace_.time("encode_mesh", [&] {
    return publisher_.publish(surface.mesh, surface.error_m, packet.plan.mesh_speed, packet);
  });
  if (!coded) return coded.error();
  if (const Status textured = add_textures(*gathered, surface.mesh, packet); !textured)
    return textured.error();
  ++sequence_;
  return codec::encode_packet(packet);
}

Result<MergeNode::Gathered> MergeNode::gather(TimePoint tick) {
  trace_.add("decode", std::exchange(decode_ms_, 0));
  Gathered out;
  for (const std::size_t i : aligner_.live_at(tick)) {
    auto scene = inputs_[i].receiver.scene();
    if (!scene) {
      drops_.count(inputs_[i].id + " → " + id(),
                   Error{Error::Cause::empty, "merger '" + id() + "' left out '" + inputs_[i].id +
                                                  "': its frame is incomplete"});
      continue;
    }
    out.views.insert(out.views.end(), scene->views.begin(), scene->views.end());
    out.sources.insert(out.sources.end(), scene->sources.begin(), scene->sources.end());
    out.scenes.push_back(*std::move(scene));
  }
  if (out.scenes.empty())
    return Error{Error::Cause::empty, "merger '" + id() + "' has no live input at this tick"};
  std::sort(out.views.begin(), out.views.end(),
            [](const View& a, const View& b) { return a.id < b.id; });
  std::sort(out.sources.begin(), out.sources.end(),
            [](const SourceInfo& a, const SourceInfo& b) { return a.sensor < b.sensor; });
  return out;
}

Result<MergeNode::Surface> MergeNode::merge_surfaces(const Gathered& gathered) {
  const double voxel_m = scene_->voxel_m;
  std::vector<merge::Part> parts(gathered.scenes.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) parts[i] = part_of(gathered.scenes[i]);
  });
  Surface out;
  for (const merge::Part& part : parts) out.error_m = std::max(out.error_m, part.error_m);

  std::vector<Mesh> owned = trace_.time("overlap", [&] {
    return merge::remove_overlap(parts, {.owner = scene_->merge.owner,
                                         .voxel_m = voxel_m,
                                         .calibration_error_m = scene_->merge.calibration_error_m,
                                         .island_area_m2 = merge::island_area_m2(voxel_m)});
  });
  trace_.time("islands", [&] {
    for (Mesh& mesh : owned) mesh = merge::remove_islands(mesh, merge::island_area_m2(voxel_m));
  });
  const Mesh zipped =
      trace_.time("zipper", [&] { return merge::zip(owned, merge::zipper_config(voxel_m)); });
  auto simplified = trace_.time("simplify", [&]() -> Result<Mesh> {
    auto snapped = codec::snap_to_lattice(zipped, scene_->lattice);
    if (!snapped || !is_root_) return snapped;
    const double target = scene_->merge.simplify.ratio * triangles_sent(parts, owned);
    simplify::Simplified small =
        simplify::simplify(*snapped, static_cast<std::size_t>(std::ceil(target)));
    out.error_m += small.error_m;
    return codec::snap_to_lattice(small.mesh, scene_->lattice);
  });
  if (!simplified) return simplified.error();

  const Mesh labelled = trace_.time("atlas", [&] {
    return atlas::label_triangles(*simplified, gathered.views,
                                  {.views = scene_->atlas.views,
                                   .geometry_error_m = texturing_error_m(*scene_, out.error_m),
                                   .precision = noisiest(gathered.sources),
                                   .min_edge_m = 2 * voxel_m});
  });
  auto snapped = codec::snap_to_lattice(labelled, scene_->lattice);
  if (!snapped) return snapped.error();
  out.mesh = kit::without_nonmanifold_edges(*snapped);
  if (out.mesh.empty())
    return Error{Error::Cause::empty, "merger '" + id() + "': no surface is left"};
  return out;
}

Status MergeNode::add_textures(const Gathered& gathered, const Mesh& mesh, Packet& packet) {
  if (is_root_ && !gathered.views.empty()) return compose_atlas(gathered, mesh, packet);
  hand_on_streams(gathered, packet);
  return {};
}

void MergeNode::hand_on_streams(const Gathered& gathered, Packet& packet) {
  packet.views = gathered.views;
  for (Input& input : inputs_) {
    std::move(input.units.begin(), input.units.end(), std::back_inserter(packet.textures));
    input.units.clear();
  }
}

Status MergeNode::compose_atlas(const Gathered& gathered, const Mesh& mesh, Packet& packet) {
  const std::uint32_t current = layout_.views.empty() ? 0 : layout_.views.front().layout;
  auto made =
      atlas::make_layout(gathered.views, scene_->atlas, scene_->coding.texture_scale, current);
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
    for (const View& view : gathered.views) {
      children[view.id] = view;
      if (!scene_->atlas.mask) continue;
      const double margin =
          atlas::margin_px(view, texturing_error_m(*scene_, last_->second.error_m), 1.0);
      used[view.id] = atlas::used_pixels(mesh, view, static_cast<int>(std::ceil(margin)));
    }
    const ImageRgb picture =
        atlas::compose_atlas(layout_, children, pictures, used, scene_->atlas.mask);
    return texture_.encode(picture, packet.plan.texture_qp, layout_.views.front().layout);
  });
  if (!unit) return unit.error();
  packet.textures.push_back(*std::move(unit));
  return {};
}

}  // namespace mr::node
