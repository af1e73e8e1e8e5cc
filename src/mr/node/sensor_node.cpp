#include "mr/node/sensor_node.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "mr/codec/mesh_codec.h"
#include "mr/core/parallel.h"
#include "mr/kit/hole_filling.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/seam/zipper.h"
#include "mr/node/capture.h"
#include "mr/simplify/simplify.h"
#include "mr/still/tiles.h"

namespace mr::node {

double texturing_error_m(const Scene& scene, float mesh_error_m) {
  return std::min<double>(mesh_error_m, scene.voxel_m) + scene.lattice.step_m() +
         scene.merge.calibration_error_m;
}

namespace {

constexpr double kPinhole_voxels = 12;  // around: what a few failed pixels leave
// Behind a pixel of the still picture, once the room is learnt. Smoothed like a single reading,
// corners become round, and small things melt into the wall behind.
constexpr int kStillReadings = 16;

fusion::VolumeConfig volume_config(const Scene& scene) {
  return {.voxel_m = scene.voxel_m,
          .truncation_m = scene.fusion.truncation_m,
          .bounds = scene.volume,
          .chunk_m = scene.fusion.chunk_m,
          .history = fusion::History::none};
}

simplify::SimplifyOptions limits_of(const Decimation& decimation, const Mesh& mesh) {
  simplify::SimplifyOptions out;
  if (decimation.ratio > 0) out.triangles = simplify::triangles_at(mesh, decimation.ratio);
  if (decimation.error_m > 0) out.error_m = static_cast<float>(decimation.error_m);
  return out;
}

/// Of some rectangles, as much as holds measurements.
std::vector<Rect> measured_parts(const ImageDepth& depth, const std::vector<Rect>& rects) {
  std::vector<Rect> out;
  for (const Rect& r : rects) {
    int left = r.x + r.width, top = r.y + r.height, right = r.x, bottom = r.y;  // ends beyond
    for (int y = r.y; y < r.y + r.height; ++y)
      for (int x = r.x; x < r.x + r.width; ++x)
        if (*depth.at(x, y) > 0) {
          left = std::min(left, x), right = std::max(right, x + 1);
          top = std::min(top, y), bottom = y + 1;
        }
    if (left < right) out.push_back({left, top, right - left, bottom - top});
  }
  return out;
}

}  // namespace

SensorNode::SensorNode(const Scene& scene, SensorId id, NodeClock clock, StillWork still_work)
    : scene_(&scene),
      sensor_(id),
      clock_(std::move(clock)),
      plan_(sensor_plan(scene, id)),
      registration_(scene.sensor(id), id),
      publisher_(scene, id),
      texture_(scene, stream_of(id)),
      still_work_(still_work) {
  const SensorConfig& sensor = scene.sensor(id);
  if (scene.still.layers && sensor.T_world_depth.size() == 1)
    layers_.emplace(
        Layers{still::Background(registration_.depth_camera(), sensor.T_world_depth.front(),
                                 {.precision = sensor.precision,
                                  .fps = scene.fps,
                                  .after_s = scene.still.after_s,
                                  .chunk_m = scene.fusion.chunk_m,
                                  .voxel_m = scene.voxel_m}),
               StillSurface(scene),
               0,
               {}});
}

SensorNode::Patch SensorNode::reconstruct_patch(const ImageDepth& depth, const Pose& T_world_depth,
                                                const Rect& rect, const Decimation& decimation,
                                                PatchWorker& worker) const {
  Patch out;
  Mesh* fused = nullptr;
  fusion::IntegrateReport report;
  {
    const Stopwatch stopwatch(out.fuse_ms);
    fused = &worker.fuser
                 .fuse({.depth = depth,
                        .camera = registration_.depth_camera(),
                        .T_world_camera = T_world_depth,
                        .region = rect,
                        .precision = scene_->sensor(sensor_).precision,
                        .slanted = layers_.has_value()},  // to lie where the still surface does
                       &report)
                 .mesh;
  }
  out.usable = report.usable;
  const Stopwatch stopwatch(out.simplify_ms);
  kit::fill_small_holes(*fused, kPinhole_voxels * scene_->voxel_m);
  auto small = worker.simplifier.run(*fused, limits_of(decimation, *fused));
  if (!small) {  // what the camera saw lies too far away
    out.usable = false;
    return out;
  }
  out.surface = *std::move(small);
  out.surface.mesh =
      merge::remove_islands(out.surface.mesh, merge::island_area_m2(scene_->voxel_m));
  return out;
}

/// Patches were reconstructed apart (paper 5): the gaps between them are closed like those between
/// sensors.
Status SensorNode::join(const std::vector<Patch>& patches, Reconstructed& out) const {
  std::vector<Mesh> parts;
  for (const Patch& patch : patches) {
    parts.push_back(patch.surface.mesh);
    out.error_m = std::max(out.error_m, patch.surface.error_m);
  }
  auto snapped = codec::snap_to_lattice(merge::zip(parts, merge::zipper_config(scene_->voxel_m)),
                                        scene_->lattice);
  if (!snapped) return snapped.error();
  out.mesh = kit::without_nonmanifold_edges(*snapped);
  return {};
}

/// The cleaned depth of a mask. Mixed pixels are known by the surfaces on both sides, so more than
/// the mask is cleaned; of panoramas and LiDARs, all.
ImageDepth SensorNode::clean_where(const ImageMask& mask, const Camera& camera,
                                   const Frame& frame) const {
  constexpr int kAround_px = 16;
  std::vector<Rect> parts{{0, 0, mask.width, mask.height}};
  if (camera.model == CameraModel::pinhole) parts = still::covering_rectangles(mask, kAround_px);
  ImageDepth out(mask.width, mask.height);
  for (const Rect& r : parts) {
    Camera cropped = camera;
    cropped.width = r.width, cropped.height = r.height;
    cropped.cx -= r.x, cropped.cy -= r.y;
    Frame part;
    part.sensor = frame.sensor, part.T_world_depth = frame.T_world_depth;
    part.depth = ImageDepth(r.width, r.height);
    for (int y = 0; y < r.height; ++y)
      std::copy_n(frame.depth.at(r.x, r.y + y), r.width, part.depth.row(y));
    const ImageDepth clean = prepare_depth(*scene_, cropped, part);
    for (int y = 0; y < r.height; ++y)
      for (int x = 0; x < r.width; ++x)
        if (*mask.at(r.x + x, r.y + y)) *out.at(r.x + x, r.y + y) = *clean.at(x, y);
  }
  return out;
}

/// Whether the merger shows all chunks of the still surface. At once: as far as can be told, the
/// background waits for some captures by itself. Who never says so is not waited for for ever.
bool SensorNode::is_still_shown() {
  constexpr int kPatience = 300;  // captures
  if (layers_->still_changed || still_job_.is_busy() || !layers_->unsent.empty()) return false;
  const bool shown =
      still_work_ == StillWork::at_once || (still_on_the_way_ == 0 && still_shown_ >= still_sent_);
  layers_->waited = shown ? 0 : layers_->waited + 1;
  return shown || layers_->waited > kPatience;
}

/// What the background says of a frame.
still::BackgroundUpdate SensorNode::look(const Frame& frame, bool is_sent) {
  const bool was_new = layers_->background.is_new();
  const still::BackgroundUpdate moment =
      trace_.time("background", [&] { return layers_->background.update(frame.depth, is_sent); });
  const bool is_learnt = was_new && !layers_->background.is_new();  // it is cleaned otherwise now
  layers_->still_changed |= moment.still_changed || is_learnt;
  layers_->began_anew |= moment.was_reset;
  return moment;
}

bool SensorNode::watch(Frame frame) {
  if (!layers_ || !layers_->background.is_new()) return false;
  frame.color = {};
  look(registration_.undistort(std::move(frame)), false);
  return layers_->background.is_new();
}

/// The cleaned depth that is to be reconstructed now: all of it, or what moves. What stays goes
/// into the chunks of the still surface.
Result<ImageDepth> SensorNode::divide(Reconstructed& out) {
  const Camera& camera = registration_.depth_camera();
  const Frame& frame = out.frame;
  ImageDepth depth;
  if (!layers_) {
    trace_.time("clean", [&] { depth = prepare_depth(*scene_, camera, frame); });
    return depth;
  }
  // Until the still surface is shown, the moving one shows what has become still.
  const still::BackgroundUpdate moment = look(frame, is_still_shown());
  trace_.time("clean", [&] {
    depth = clean_where(moment.moving, camera, frame);
    out.confirmed_depth = still::confirmed_tiles(moment.confirmed, moment.moving);
    if (const auto view = registration_.color_view(frame.T_world_depth);
        view && !frame.color.empty())
      out.confirmed_color =
          still::unoccluded_tiles(frame.depth, moment.foreign, camera, view->camera(),
                                  view->T_world_camera.inverse() * frame.T_world_depth);
  });
  if (const Status brought = bring_still(frame, out.plan); !brought) return brought.error();
  return depth;
}

/// The chunks of a frozen still picture that changed. `readings`: behind its pixels.
SensorNode::StillChunks SensorNode::make_still(const Frame& still, int readings, double error_m) {
  return trace_.time("still", [&] {
    const Camera& camera = registration_.depth_camera();
    return layers_->surface.update(prepare_depth(*scene_, camera, still, readings), camera,
                                   still.T_world_depth, scene_->sensor(sensor_).precision, error_m);
  });
}

/// Takes what was made of the still picture, while no job is busy.
Status SensorNode::accept(StillChunks made) {
  if (!made) {
    layers_->still_changed = true;
    return made.error();
  }
  layers_->chunks = layers_->surface.chunks();
  std::ranges::move(*made, std::back_inserter(layers_->unsent));  // newer ones come later
  return {};
}

/// What was made of the still picture, and where that is another by now, what is to be made of it.
Status SensorNode::bring_still(const Frame& frame, const CodingPlan& plan) {
  if (std::optional<StillChunks> made = still_job_.take())
    if (const Status accepted = accept(*std::move(made)); !accepted) return accepted;
  const bool is_replanned = plan.still_error_m != layers_->still_error_m && layers_->chunks > 0;
  if ((!layers_->still_changed && !is_replanned) || still_job_.is_busy()) return {};
  layers_->still_changed = false, layers_->still_error_m = plan.still_error_m;
  Frame still;
  still.sensor = sensor_, still.depth = layers_->background.still();
  still.T_world_depth = frame.T_world_depth;
  const int readings = layers_->background.is_new() ? 1 : kStillReadings;
  if (still_work_ == StillWork::at_once || layers_->background.is_new())
    return accept(make_still(still, readings, plan.still_error_m));
  still_job_.start([this, still = std::move(still), readings, error_m = plan.still_error_m] {
    return make_still(still, readings, error_m);
  });
  return {};
}

Result<SensorNode::Reconstructed> SensorNode::reconstruct(Frame raw) {
  Reconstructed out;
  out.plan = plan_.get();
  out.frame = trace_.time("register", [&] { return registration_.undistort(std::move(raw)); });
  auto divided = divide(out);
  if (!divided) return divided.error();
  const ImageDepth depth = *std::move(divided);
  double fuse_ms = 0, simplify_ms = 0;
  // A patch is decimated as soon as it is fused: none waits for the others.
  auto rects = fusion::patches(depth.width, depth.height, scene_->fusion);
  if (layers_) rects = measured_parts(depth, rects);
  std::vector<Patch> patches(rects.size());
  while (workers_.size() < rects.size())
    workers_.push_back({fusion::FrameFuser(volume_config(*scene_)), {}});
  parallel_for(patches.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      isolated([&] {
        patches[i] = reconstruct_patch(depth, out.frame.T_world_depth, rects[i],
                                       out.plan.decimation, workers_[i]);
      });
  });
  if (!std::all_of(patches.begin(), patches.end(), [](const Patch& p) { return p.usable; }))
    return Error{Error::Cause::invalid,
                 "frame " + std::to_string(out.frame.index) +
                     ": camera or pose cannot be used (not a rotation, not finite, or farther than "
                     "1000 km)"};
  for (const Patch& patch : patches) fuse_ms += patch.fuse_ms, simplify_ms += patch.simplify_ms;
  Status joined;
  {
    const Stopwatch stopwatch(simplify_ms);
    joined = join(patches, out);
  }
  trace_.add("fuse", fuse_ms);
  trace_.add("simplify", simplify_ms);
  if (!joined) return joined.error();
  if (layers_) {
    out.still = std::exchange(layers_->unsent, {});
    if (!out.still.empty()) ++still_on_the_way_, layers_->waited = 0;
    out.began_anew = std::exchange(layers_->began_anew, false);
  }
  return out;
}

bool SensorNode::is_empty(const Reconstructed& surface) const {
  return surface.mesh.empty() && (!layers_ || layers_->chunks == 0);
}

std::string SensorNode::pushed(const Frame& frame) const {
  return "frame " + std::to_string(frame.index) +
         ": most of the room is not where it was; was the camera pushed? It learns the room anew";
}

Error SensorNode::no_surface(const Frame& frame) const {
  return {Error::Cause::empty,
          "frame " + std::to_string(frame.index) +
              ": depth holds no surface (nothing in the volume, or all pixels invalid?)"};
}

/// Everything but mesh and picture.
Packet SensorNode::head(const Reconstructed& surface) const {
  const Frame& frame = surface.frame;
  Packet packet;
  packet.scene = scene_->id, packet.node = id();
  packet.epoch = clock_.epoch, packet.sequence = sequence_;
  packet.captured_at = frame.captured_at();
  packet.plan = surface.plan;
  packet.sources = {{sensor_, frame.captured_at(), registration_.depth_camera(),
                     frame.T_world_depth, scene_->sensor(sensor_).precision,
                     surface.confirmed_depth, surface.confirmed_color}};
  if (auto view =
          frame.color.empty() ? std::nullopt : registration_.color_view(frame.T_world_depth)) {
    view->stream = stream_of(sensor_);
    packet.views = {*view};
  }
  return packet;
}

/// Which view textures what is decided where surfaces meet, by the mergers: here all is the
/// sensor's own.
Status SensorNode::add_mesh(const Reconstructed& surface, Packet& packet) {
  return trace_.time("encode_mesh", [&] {
    Mesh mesh = surface.mesh;
    set_sensor(mesh, sensor_);
    for (StillChunk chunk : surface.still) {
      set_sensor(chunk.mesh, sensor_);
      publisher_.set_still(chunk.cube, std::move(chunk.mesh), chunk.error_m);
    }
    return publisher_.publish(mesh, surface.error_m, packet.plan.mesh_speed, packet);
  });
}

Result<std::vector<std::byte>> SensorNode::code(const Reconstructed& surface) {
  // Where this packet comes to nothing, the next one has the same sequence and brings the chunks.
  if (!surface.still.empty()) still_sent_ = sequence_ + 1, --still_on_the_way_;
  Packet packet = head(surface);
  if (clock_.now) packet.marks.push_back({"sensors/reconstructed", clock_.now()});
  if (const Status coded = add_mesh(surface, packet); !coded) return coded.error();
  if (!packet.views.empty()) {
    auto unit = trace_.time("encode_video", [&] {
      return texture_.encode(surface.frame.color, packet.plan.texture_qp, 0);
    });
    if (!unit) return unit.error();
    packet.textures.push_back(*std::move(unit));
  }
  if (clock_.now) packet.marks.push_back({"sensors/coded", clock_.now()});
  ++sequence_;
  return writer_.write(std::move(packet));
}

std::vector<std::byte> SensorNode::answer(const codec::Control& control) {
  if (control.plan) plan_.set(control.plan->sensors);
  if (control.wants_key_frame(stream_of(sensor_))) texture_.ask_key_frame();
  if (control.whole_head) writer_.ask_whole();
  if (control.shown && *control.shown < sequence_)  // else of another epoch
    still_shown_ = std::max<std::uint64_t>(still_shown_, *control.shown + 1);
  return publisher_.answer(control.chunks);
}

}  // namespace mr::node
