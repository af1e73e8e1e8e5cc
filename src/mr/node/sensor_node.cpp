#include "mr/node/sensor_node.h"

#include <algorithm>
#include <utility>

#include "mr/codec/alpha_codec.h"
#include "mr/node/capture.h"

namespace mr::node {

double texturing_error_m(const Scene& scene, float mesh_error_m) {
  return std::min<double>(mesh_error_m, scene.voxel_m) + scene.lattice.step_m() +
         scene.merge.calibration_error_m;
}

namespace {

/// Only of a sensor that stands still.
bool has_layers(const Scene& scene, SensorId id) {
  return scene.still.layers && !scene.sensor(id).is_moving();
}

/// With what names the chunks.
double still_bytes(const Packet& packet) {
  double out = 0;
  for (const EncodedChunk& chunk : packet.chunks)
    if (chunk.key.id.layer == Layer::still)
      out += static_cast<double>(chunk.payload.size()) + ChunkPublisher::kNameBytes;
  return out;
}

double share_of_measured(const ImageDepth& depth) {
  const auto pixels = static_cast<double>(depth.data.size());
  const auto measured = std::ranges::count_if(depth.data, [](float z) { return z > 0; });
  return pixels > 0 ? static_cast<double>(measured) / pixels : 0;
}

}  // namespace

SensorNode::SensorNode(const Scene& scene, SensorId id, NodeClock clock, StillWork still_work)
    : scene_(&scene),
      sensor_(id),
      clock_(std::move(clock)),
      plan_(sensor_plan(scene, id)),
      registration_(scene.sensor(id), id),
      reconstructor_(scene, scene.sensor(id), registration_.depth_camera(), trace_),
      publisher_(scene, id),
      texture_(scene, stream_of(id)) {
  if (const auto view = registration_.color_view({}))
    blind_tiles_.emplace(registration_.depth_camera(), view->camera(),
                         view->T_world_camera.inverse(),
                         sensor::ReconstructedSpace{scene.volume, scene.floor, scene.up});
  if (scene.rate.model != RateConfig::Model::fixed) features_.emplace(scene.sensor(id).precision);
  if (has_layers(scene, id)) layers_.emplace(scene, id, registration_, still_work, trace_);
  const bool is_controlled = scene.rate.model != RateConfig::Model::fixed;
  for (const LinkConfig& link : scene.links)
    if (is_controlled && layers_ && link.from == this->id() && link.limit_mbps > 0)
      link_pace_.emplace(link.limit_mbps, scene.fps);
}

bool SensorNode::watch(Frame frame) {
  if (layers_ && layers_->is_new()) learn(std::move(frame));
  return layers_ && layers_->is_new();
}

void SensorNode::learn(Frame frame) {
  frame.color = {};
  if (layers_) layers_->learn(registration_.undistort(std::move(frame)));
}

std::optional<SensorLayers::Memory> SensorNode::memory() const {
  return layers_ ? std::optional(layers_->memory()) : std::nullopt;
}

void SensorNode::recall(SensorLayers::Memory memory) {
  if (layers_) layers_->recall(std::move(memory));
}

/// The cleaned depth that is to be reconstructed: of all, or of what moves.
Result<ImageDepth> SensorNode::depth_to_reconstruct(Reconstructed& out) {
  const Frame& frame = out.frame;
  const auto add_blind_tiles = [&](const ImageDepth& cleaned, const ImageMask* of) {
    if (blind_tiles_ && !frame.color.empty())
      out.blind_color = blind_tiles_->blind(frame.depth, cleaned, of, frame.T_world_depth);
  };
  if (!layers_)
    return trace_.time("clean", [&] {
      ImageDepth cleaned = prepare_depth(*scene_, registration_.depth_camera(), frame);
      add_blind_tiles(cleaned, nullptr);
      return cleaned;
    });
  auto divided = layers_->divide(out.frame, out.plan.still_error_m);
  if (!divided) return divided.error();
  out.confirmed_depth = std::move(divided->confirmed_depth);
  out.confirmed_color = std::move(divided->confirmed_color);
  add_blind_tiles(divided->moving, &divided->moving_pixels);
  out.alpha = std::move(divided->outline.alpha);
  return std::move(divided->outline.depth);
}

Result<SensorNode::Reconstructed> SensorNode::reconstruct(Frame raw) {
  Reconstructed out;
  out.plan = plan_.get();
  out.frame = trace_.time("register", [&] { return registration_.undistort(std::move(raw)); });
  rate::SceneFeatures features;
  if (features_) trace_.time("features", [&] { features = features_->extract(out.frame); });
  const auto depth = depth_to_reconstruct(out);
  if (!depth) return depth.error();
  auto surface = reconstructor_.run(*depth, out.frame.T_world_depth, out.plan.decimation);
  if (!surface)
    return Error{surface.error().cause,
                 "frame " + std::to_string(out.frame.index) + ": " + surface.error().message};
  out.mesh = std::move(surface->mesh), out.errors = std::move(surface->errors);
  if (layers_) out.still = layers_->take_news();
  if (features_) {
    features.mask_coverage = share_of_measured(*depth);
    features.triangles = static_cast<double>(surface->fused_triangles);
    out.features = {sensor_, !out.frame.color.empty(), rate::values_of(features)};
  }
  return out;
}

bool SensorNode::is_empty(const Reconstructed& surface) const {
  return surface.mesh.empty() && (!layers_ || layers_->chunks() == 0);
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
                     surface.confirmed_depth, surface.confirmed_color, surface.blind_color}};
  if (surface.features) packet.features = {*surface.features};
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
    if (!surface.still.chunks.empty()) unsent_stills_.push_back(publisher_.publications());
    for (StillChunk chunk : surface.still.chunks) {
      set_sensor(chunk.piece.mesh, sensor_);
      publisher_.set_still(chunk.cube, std::move(chunk.piece));
    }
    publisher_.set_moving(mesh, surface.errors);
    return publish(packet);
  });
}

/// Where this packet comes to nothing, the next one has the same sequence and names the chunks:
/// receivers ask for those that it does not bring.
Status SensorNode::publish(Packet& packet) {
  Allowance of_still;
  if (link_pace_) of_still = link_pace_->next(publisher_.waiting_bytes() > 0);
  if (const Status done = publisher_.publish(packet.plan.mesh_speed, packet, of_still); !done)
    return done;
  const std::uint32_t until = publisher_.sent_until();
  for (; !unsent_stills_.empty() && unsent_stills_.front() < until; unsent_stills_.pop_front())
    layers_->note_sent(sequence_);
  return {};
}

Status SensorNode::add_picture(const Reconstructed& surface, Packet& packet) {
  if (packet.views.empty()) return {};
  auto unit = trace_.time("encode_video", [&] {
    return texture_.encode(surface.frame.color, packet.plan.texture_qp, 0);
  });
  if (!unit) return unit.error();
  packet.textures.push_back(*std::move(unit));
  if (std::ranges::count(surface.alpha.data, 0) > 0)
    packet.alpha = {{stream_of(sensor_), AlphaPlane::kStep_px, surface.alpha.width,
                     surface.alpha.height, codec::encode_alpha(surface.alpha)}};
  return {};
}

Result<std::vector<std::byte>> SensorNode::code(const Reconstructed& surface) {
  Packet packet = head(surface);
  if (clock_.now) packet.marks.push_back({"sensors/reconstructed", clock_.now()});
  if (const Status coded = add_mesh(surface, packet); !coded) return coded.error();
  if (const Status coded = add_picture(surface, packet); !coded) return coded.error();
  if (clock_.now) packet.marks.push_back({"sensors/coded", clock_.now()});
  ++sequence_;
  const double still = still_bytes(packet);
  std::vector<std::byte> bytes = writer_.write(std::move(packet));
  if (link_pace_) link_pace_->sent(static_cast<double>(bytes.size()), still);
  return bytes;
}

std::vector<std::byte> SensorNode::answer(const codec::Control& control) {
  if (control.plan) plan_.set(control.plan->of(sensor_));
  if (control.wants_key_frame(stream_of(sensor_))) texture_.ask_key_frame();
  if (control.whole_head) writer_.ask_whole();
  if (layers_ && control.shown && *control.shown < sequence_)  // else of another epoch
    layers_->note_shown(*control.shown);
  return publisher_.answer(control.chunks);
}

}  // namespace mr::node
