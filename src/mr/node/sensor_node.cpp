#include "mr/node/sensor_node.h"

#include <algorithm>
#include <utility>

#include "mr/codec/mesh_codec.h"
#include "mr/core/parallel.h"
#include "mr/kit/pinholes.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/zipper.h"
#include "mr/node/capture.h"
#include "mr/simplify/simplify.h"

namespace mr::node {

double texturing_error_m(const Scene& scene, float mesh_error_m) {
  return std::min<double>(mesh_error_m, scene.voxel_m) + scene.lattice.step_m() +
         scene.merge.calibration_error_m;
}

namespace {

constexpr double kPinhole_voxels = 12;  // around: what a few failed pixels leave

fusion::VolumeConfig volume_config(const Scene& scene) {
  return {.voxel_m = scene.voxel_m,
          .truncation_m = scene.fusion.truncation_m,
          .bounds = scene.volume,
          .chunk_m = scene.fusion.chunk_m,
          .history = scene.fusion.memory ? fusion::History::remember : fusion::History::none};
}

}  // namespace

SensorNode::SensorNode(const Scene& scene, std::uint32_t sensor_index, NodeClock clock)
    : scene_(&scene),
      sensor_(sensor_index),
      clock_(std::move(clock)),
      registration_(scene.sensors[sensor_index], sensor_index),
      publisher_(scene, sensor_index),
      texture_(scene, sensor_index) {}

SensorNode::Patch SensorNode::reconstruct_patch(const ImageDepth& depth, const Pose& T_world_depth,
                                                const Rect& rect, PatchWorker& worker) const {
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
                        .precision = scene_->sensors[sensor_].precision},
                       &report)
                 .mesh;
  }
  out.usable = report.usable;
  const Stopwatch stopwatch(out.simplify_ms);
  kit::close_pinholes(*fused, kPinhole_voxels * scene_->voxel_m);
  auto small = worker.simplifier.run(
      *fused, {.triangles = simplify::triangles_at(*fused, scene_->simplify.ratio)});
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

Result<SensorNode::Reconstructed> SensorNode::reconstruct(Frame raw) {
  Reconstructed out;
  out.frame = trace_.time("register", [&] { return registration_.undistort(std::move(raw)); });
  double fuse_ms = 0, simplify_ms = 0;
  ImageDepth depth;
  {
    const Stopwatch stopwatch(fuse_ms);
    depth = prepare_depth(*scene_, registration_.depth_camera(), out.frame);
  }
  // A patch is decimated as soon as it is fused: none waits for the others.
  const auto rects = fusion::patches(depth.width, depth.height, scene_->fusion);
  std::vector<Patch> patches(rects.size());
  while (workers_.size() < rects.size())
    workers_.push_back({fusion::FrameFuser(volume_config(*scene_)), {}});
  parallel_for(patches.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      isolated([&] {
        patches[i] = reconstruct_patch(depth, out.frame.T_world_depth, rects[i], workers_[i]);
      });
  });
  if (!std::all_of(patches.begin(), patches.end(), [](const Patch& p) { return p.usable; }))
    return Error{Error::Cause::invalid,
                 "sensor '" + id() + "': frame " + std::to_string(out.frame.index) +
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
  return out;
}

Error SensorNode::no_surface(const Frame& frame) const {
  return {Error::Cause::empty,
          "sensor '" + id() + "': frame " + std::to_string(frame.index) +
              ": depth holds no surface (nothing in the volume, or all pixels invalid?)"};
}

/// Everything but mesh and picture.
Packet SensorNode::head(const Frame& frame) const {
  Packet packet;
  packet.scene = scene_->id, packet.node = id();
  packet.epoch = clock_.epoch, packet.sequence = sequence_;
  packet.captured_at = frame.captured_at();
  packet.plan = {static_cast<float>(scene_->simplify.ratio), 5, 1,
                 scene_->coding.sensor_texture_qp};
  packet.sources = {{sensor_, frame.captured_at(), registration_.depth_camera(),
                     frame.T_world_depth, scene_->sensors[sensor_].precision}};
  if (auto view =
          frame.color.empty() ? std::nullopt : registration_.color_view(frame.T_world_depth)) {
    view->stream = sensor_;
    packet.views = {*view};
  }
  return packet;
}

/// Which view textures what is decided where surfaces meet, by the mergers: here all is the
/// sensor's own.
Status SensorNode::add_mesh(const Reconstructed& surface, Packet& packet) {
  return trace_.time("encode_mesh", [&] {
    Mesh mesh = surface.mesh;
    const ViewId view = packet.views.empty() ? kNoView : packet.views.front().id;
    set_triangle_views(mesh, std::vector<ViewId>(mesh.triangles.size(), view));
    return publisher_.publish(mesh, surface.error_m, packet.plan.mesh_speed, packet);
  });
}

Result<std::vector<std::byte>> SensorNode::code(const Reconstructed& surface) {
  Packet packet = head(surface.frame);
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

std::vector<std::byte> SensorNode::answer(const codec::Request& request) {
  if (request.wants_key_frame(sensor_)) texture_.ask_key_frame();
  if (request.whole_head) writer_.ask_whole();
  return publisher_.answer(request.chunks);
}

}  // namespace mr::node
