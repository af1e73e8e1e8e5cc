#include "mr/node/pipeline.h"

#include <sys/resource.h>

#include <algorithm>
#include <chrono>

#include "mr/codec/packet_codec.h"
#include "mr/kit/topology.h"
#include "mr/sensor/rgbd_images.h"
#include "mr/synth/room.h"

namespace mr::node {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

double peak_rss_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

std::vector<std::unique_ptr<FrameSource>> open_sources(const Scene& scene) {
  const auto room =
      scene.rig ? std::make_shared<const synth::Room>(synth::make_room(*scene.rig)) : nullptr;
  std::vector<std::unique_ptr<FrameSource>> out;
  for (std::uint32_t i = 0; i < scene.sensors.size(); ++i) {
    const SensorConfig& sensor = scene.sensors[i];
    out.push_back(std::holds_alternative<SyntheticSource>(sensor.source)
                      ? synth::open_synthetic(room, *scene.rig, sensor, i, scene.fps)
                      : sensor::open_rgbd_images(sensor, i, scene.fps));
  }
  return out;
}

}  // namespace

/// What one run adds up.
struct Pipeline::Measured {
  int frames = 0;
  std::uint64_t mesh_bytes = 0, texture_bytes = 0, chunks_new = 0, chunks_kept = 0;
  std::vector<double> end_to_end_ms;
  std::map<std::string, std::vector<double>> node_ms;  // per frame: receiving and processing
  std::map<std::string, double> receiving_ms;          // of the frame under way
};

Pipeline::Pipeline(std::unique_ptr<Scene> scene)
    : scene_(std::move(scene)), client_(scene_->lattice) {
  sources_ = open_sources(*scene_);
  for (std::uint32_t i = 0; i < scene_->sensors.size(); ++i)
    sensors_.push_back(std::make_unique<SensorNode>(*scene_, i));
  for (const MergerConfig& merger : scene_->mergers) {
    const auto ask = [this, inputs = merger.inputs](
                         std::size_t input,
                         const ChunkKey& key) -> std::shared_ptr<const EncodedChunk> {
      for (const auto& s : sensors_)
        if (s->id() == inputs[input]) return s->find(key);
      for (const auto& m : mergers_)
        if (m->id() == inputs[input]) return m->find(key);
      return nullptr;
    };
    const bool is_root = &merger == &scene_->mergers.back();
    mergers_.push_back(std::make_unique<MergeNode>(*scene_, merger, is_root, ask));
  }
}

Result<std::unique_ptr<Pipeline>> Pipeline::open(Scene scene) {
  if (scene.rig) scene.sensors = synth::rig_sensors(*scene.rig);
  if (scene.sensors.empty() || scene.mergers.empty())
    return Error{Error::Cause::empty, "scene '" + scene.id + "' has no sensors"};
  return std::unique_ptr<Pipeline>(new Pipeline(std::make_unique<Scene>(std::move(scene))));
}

Pipeline::Edge Pipeline::edge_from(const std::string& id) {
  for (const auto& merger : mergers_) {
    const auto& inputs = merger->config().inputs;
    const auto found = std::find(inputs.begin(), inputs.end(), id);
    if (found != inputs.end())
      return {merger.get(), static_cast<std::size_t>(found - inputs.begin())};
  }
  return {};
}

void Pipeline::drop(const std::string& place, const Error& error, const RunListener& listener) {
  drops_.count(place, error);
  if (listener.dropped) listener.dropped(error.message);
}

/// One frame of every source; false when all have ended.
bool Pipeline::capture(std::vector<std::optional<Frame>>& frames, const RunListener& listener) {
  frames.assign(sources_.size(), std::nullopt);
  bool any = false;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    auto frame = sources_[i]->next();
    any |= !frame || frame->has_value();
    if (frame) {
      frames[i] = *std::move(frame);
    } else {
      const std::string& id = scene_->sensors[i].id;
      drop(id, Error{frame.error().cause, "sensor '" + id + "': " + frame.error().message},
           listener);
    }
  }
  return any;
}

void Pipeline::deliver(const Edge& edge, const std::vector<std::byte>& bytes, TimePoint now,
                       Measured& measured, const RunListener& listener) {
  if (!edge.merger) return show(bytes, measured, listener);
  const auto start = Clock::now();
  const Status taken = edge.merger->receive(edge.input, bytes, now);
  measured.receiving_ms[edge.merger->id()] += ms_since(start);
  if (!taken && listener.dropped) listener.dropped(taken.error().message);
}

/// The client's side: decodes what the root sent.
void Pipeline::show(const std::vector<std::byte>& bytes, Measured& measured,
                    const RunListener& listener) {
  auto packet = codec::decode_packet(bytes);
  if (!packet) return drop("client", packet.error(), listener);
  for (const Error& error : client_.accept(*packet)) drop("client", error, listener);
  for (const ChunkKey& key : client_.missing())
    if (const auto chunk = mergers_.back()->find(key))
      if (const Status taken = client_.provide(*chunk); !taken)
        drop("client", taken.error(), listener);
  auto scene = client_.scene();
  if (!scene)
    return drop("client", Error{Error::Cause::empty, "client: a frame stayed incomplete"},
                listener);
  decoded_ = *std::move(scene);
  last_packet_ = bytes;

  ++measured.frames;
  std::uint64_t texture = 0;
  for (const TextureUnit& unit : packet->textures) texture += unit.data.size();
  measured.texture_bytes += texture;
  measured.mesh_bytes += bytes.size() - texture;
  measured.chunks_new += packet->chunks.size();
  measured.chunks_kept += packet->manifest.size() - packet->chunks.size();
}

void Pipeline::run_frame(std::vector<std::optional<Frame>> frames, Measured& measured,
                         const RunListener& listener) {
  TimePoint now{};
  measured.receiving_ms.clear();
  const auto captured = Clock::now();
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    if (!frames[i]) continue;
    SensorNode& sensor = *sensors_[i];
    if (listener.progress) listener.progress(measured.frames, 0, sensor.id());
    now = std::max(now, frames[i]->captured_at());
    const auto start = Clock::now();
    const auto bytes = sensor.process(*std::move(frames[i]));
    measured.node_ms[sensor.id()].push_back(ms_since(start));
    if (bytes)
      deliver(edge_from(sensor.id()), *bytes, now, measured, listener);
    else
      drop(sensor.id(), bytes.error(), listener);
  }
  const int shown = measured.frames;
  for (const auto& merger : mergers_) {  // children before parents
    if (listener.progress) listener.progress(measured.frames, 0, merger->id());
    now += std::chrono::ceil<Duration>(
        std::chrono::duration<double, std::milli>(merger->config().deadline_ms));
    const auto start = Clock::now();
    const auto bytes = merger->merge(now);
    if (!merger->reused())  // a frame in which nothing moved would flatter the figures
      measured.node_ms[merger->id()].push_back(ms_since(start) +
                                               measured.receiving_ms[merger->id()]);
    if (!bytes)
      drop(merger->id(), bytes.error(), listener);
    else if (*bytes)
      deliver(edge_from(merger->id()), **bytes, now, measured, listener);
    else
      drop(merger->id(), {Error::Cause::empty, "merger '" + merger->id() + "' has no live input"},
           listener);
  }
  if (measured.frames > shown) measured.end_to_end_ms.push_back(ms_since(captured));
}

Result<RunReport> Pipeline::run(int frames, const RunListener& listener) {
  Measured measured;
  const auto start = Clock::now();
  std::vector<std::optional<Frame>> captured;
  for (int f = 0; f < frames && capture(captured, listener); ++f) {
    const RunListener numbered{
        listener.progress
            ? [&, f](int, int, const std::string& node) { listener.progress(f, frames, node); }
            : RunListener{}.progress,
        listener.dropped};
    run_frame(std::move(captured), measured, numbered);
  }
  if (measured.frames == 0)
    return Error{Error::Cause::empty, "scene '" + scene_->id + "': no frame came through (" +
                                          std::to_string(drops_.total()) + " drops)"};
  return report(measured, ms_since(start) / 1000);
}

/// The slowest node of each layer of the tree, summed over the layers.
double Pipeline::critical_path_ms(const Measured& measured) const {
  std::map<std::string, int> layer;
  std::map<int, double> slowest;
  const auto note = [&](const std::string& id, int l) {
    layer[id] = l;
    const auto ms = measured.node_ms.find(id);
    if (ms != measured.node_ms.end())
      slowest[l] = std::max(slowest[l], percentile(ms->second, 0.5));
  };
  for (const auto& sensor : sensors_) note(sensor->id(), 0);
  for (const auto& merger : mergers_) {
    int below = 0;
    for (const std::string& input : merger->config().inputs) below = std::max(below, layer[input]);
    note(merger->id(), below + 1);
  }
  double sum = 0;
  for (const auto& [l, ms] : slowest) sum += ms;
  return sum;
}

RunReport Pipeline::report(const Measured& m, double seconds) const {
  RunReport r;
  r.scene = scene_->id;
  r.frames = m.frames;
  r.fps = m.frames / seconds;
  r.sensors = static_cast<int>(sensors_.size());
  r.peak_rss_mb = peak_rss_mb();
  Mesh merged;
  for (const auto& chunk : decoded_->chunks) append(merged, chunk->mesh);
  merged = kit::weld(merged);
  r.triangles = merged.triangles.size(), r.vertices = merged.positions.size();
  r.mesh_bytes_per_frame = static_cast<double>(m.mesh_bytes) / m.frames;
  r.texture_bytes_per_frame = static_cast<double>(m.texture_bytes) / m.frames;
  for (const auto& chunk : decoded_->chunks)
    if (const auto coded = mergers_.back()->find(chunk->key))
      r.refresh_bytes += coded->payload.size();
  r.chunks_new = m.chunks_new, r.chunks_kept = m.chunks_kept;
  r.drops = drops_.by_cause();
  const auto add = [](RunReport::Stages& all, const Trace& trace) {
    for (const auto& [stage, ms] : trace.stages())
      all[stage].insert(all[stage].end(), ms.begin(), ms.end());
  };
  for (const auto& sensor : sensors_) add(r.sensor_stages_ms, sensor->trace());
  for (const auto& merger : mergers_) {
    add(r.merge_stages_ms, merger->trace());
    for (const auto& [cause, n] : merger->drops().by_cause()) r.drops[cause] += n;
  }
  r.critical_path_ms = critical_path_ms(m);
  r.end_to_end_ms = m.end_to_end_ms;
  return r;
}

}  // namespace mr::node
