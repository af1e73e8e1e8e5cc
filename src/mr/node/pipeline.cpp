#include "mr/node/pipeline.h"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <set>

#include "mr/codec/packet_codec.h"
#include "mr/kit/topology.h"
#include "mr/node/sources.h"

namespace mr::node {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace

/// What one run adds up.
struct Pipeline::Measured {
  int frame = 0;   // under way
  int frames = 0;  // that reached the client
  bool any_surface = false;
  int last_frame = -1;  // the newest of them
  std::uint64_t mesh_bytes = 0, texture_bytes = 0, chunks_new = 0, chunks_kept = 0;
  std::vector<double> end_to_end_ms;
  std::map<std::string, std::vector<double>> node_ms;  // per frame: receiving and processing
  // Of the frame under way:
  std::map<std::string, double> receiving_ms, alone_ms;  // alone_ms: all of a node's work
  CaptureCost cost;
  std::set<std::string> silent;  // nodes that bring nothing; if that is a loss, it was told
  const RunListener* listener = nullptr;
};

Pipeline::Pipeline(std::unique_ptr<Scene> scene, const std::filesystem::path& cache_folder)
    : scene_(std::move(scene)), client_(scene_->lattice) {
  std::vector<std::uint32_t> all(scene_->sensors.size());
  std::iota(all.begin(), all.end(), 0u);
  sources_ = open_sources(*scene_, all, cache_folder);
  for (std::uint32_t i = 0; i < scene_->sensors.size(); ++i)
    sensors_.push_back(std::make_unique<SensorNode>(*scene_, i));
  for (const MergerConfig& merger : scene_->mergers) {
    const bool is_root = &merger == &scene_->mergers.back();
    mergers_.push_back(std::make_unique<MergeNode>(*scene_, merger, is_root));
  }
}

void Pipeline::skip(std::uint64_t frames) {
  for (const auto& source : sources_) source->skip(frames);
}

void Pipeline::ask_key_frames(std::vector<std::uint32_t> streams) {
  ask(mergers_.back()->id(), {std::move(streams), {}, {}});
}

std::optional<Mesh> Pipeline::surface() const { return mergers_.back()->surface(); }

/// A node's answer to a request; empty when it has none.
std::vector<std::byte> Pipeline::ask(const std::string& id, const codec::Request& request) {
  for (const auto& sensor : sensors_)
    if (sensor->id() == id) return sensor->answer(request);
  for (const auto& merger : mergers_)
    if (merger->id() == id) return merger->answer(request);
  return {};
}

/// Passes a merger's requests to its inputs, and the answers back.
void Pipeline::serve(MergeNode& merger, TimePoint now) {
  merger.inputs().ask_key_frames(merger.take_key_frame_wishes());
  for (const auto& [input, request] : merger.inputs().requests(now)) {
    const auto answer = ask(merger.config().inputs[input], request);
    if (!answer.empty()) merger.inputs().take_answer(input, answer, now);
  }
}

Result<std::unique_ptr<Pipeline>> Pipeline::open(Scene given,
                                                 const std::filesystem::path& cache_folder) {
  auto scene = prepare_scene(std::move(given));
  if (!scene) return scene.error();
  auto background = open_background(*scene);
  if (!background) return background.error();
  std::unique_ptr<Pipeline> made(
      new Pipeline(std::make_unique<Scene>(*std::move(scene)), cache_folder));
  made->mergers_.back()->set_background(*std::move(background));
  return made;
}

/// A node feeds one merger, or several with a region each; none: the client.
std::vector<Pipeline::Edge> Pipeline::edges_from(const std::string& id) {
  std::vector<Edge> edges;
  for (const auto& merger : mergers_) {
    const auto& inputs = merger->config().inputs;
    const auto found = std::find(inputs.begin(), inputs.end(), id);
    if (found != inputs.end())
      edges.push_back({merger.get(), static_cast<std::size_t>(found - inputs.begin())});
  }
  return edges;
}

/// One frame of every source; false when all have ended.
bool Pipeline::capture(std::vector<std::optional<Frame>>& frames) {
  frames.assign(sources_.size(), std::nullopt);
  bool any = false;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    auto frame = sources_[i]->next();
    any |= !frame || frame->has_value();
    if (frame)
      frames[i] = *std::move(frame);
    else
      drops_.count(scene_->sensors[i].id, frame.error());
  }
  return any;
}

void Pipeline::deliver(const std::string& from, const std::vector<std::byte>& bytes, TimePoint now,
                       Measured& measured) {
  const std::vector<Edge> edges = edges_from(from);
  if (edges.empty()) return show(bytes, measured);
  for (const Edge& edge : edges) {
    const auto start = Clock::now();
    const double cpu_before = process_cpu_ms();
    // A refusal is counted, and told, by the merger.
    static_cast<void>(edge.merger->inputs().receive(edge.input, bytes, now).ok());
    serve(*edge.merger, now);
    measured.receiving_ms[edge.merger->id()] += ms_since(start);
    measured.cost.mergers_cpu_ms += process_cpu_ms() - cpu_before;
  }
}

void Pipeline::take_answer(const std::vector<std::byte>& answer) {
  if (answer.empty()) return;
  const auto chunks = codec::decode_chunks(answer);
  if (!chunks) return drops_.count("client", chunks.error());
  for (const EncodedChunk& chunk : *chunks)
    if (const Status taken = client_.provide(chunk); !taken) drops_.count("client", taken.error());
}

/// The client's side: decodes what the root sent.
void Pipeline::show(const std::vector<std::byte>& bytes, Measured& measured) {
  if (measured.listener->packet) measured.listener->packet(measured.frame, bytes);
  auto packet = client_heads_.read(bytes);
  if (!packet) return drops_.count("client", packet.error());
  for (const Error& error : client_.accept(*packet)) drops_.count("client", error);
  const codec::Request lacking{client_.streams_waiting(), client_.missing(), {}};
  if (!lacking.empty()) take_answer(ask(mergers_.back()->id(), lacking));
  auto scene = client_.scene();
  if (!scene) return drops_.count("client", {Error::Cause::empty, "a frame stayed incomplete"});
  measured.any_surface |= !scene->chunks.empty();
  decoded_ = *std::move(scene);

  ++measured.frames;
  measured.last_frame = measured.frame;
  std::uint64_t texture = 0;
  for (const TextureUnit& unit : packet->textures) texture += unit.data.size();
  measured.texture_bytes += texture;
  measured.mesh_bytes += bytes.size() - texture;
  CaptureCost& cost = measured.cost;
  cost.shown = true, cost.texture_bytes = texture;
  for (const TextureUnit& unit : packet->textures)
    if (unit.stream == RootAtlas::kPlateStream) cost.plate_bytes += unit.data.size();
  for (const EncodedChunk& chunk : packet->chunks) cost.mesh_bytes += chunk.payload.size();
  cost.head_bytes = bytes.size() - texture - cost.mesh_bytes;
  cost.key_frame = std::ranges::any_of(packet->textures, &TextureUnit::key_frame);
  if (measured.listener->sent)
    measured.listener->sent(measured.frame, bytes.size() - texture, texture);
  if (measured.listener->shown) measured.listener->shown(measured.frame, *decoded_);
  measured.chunks_new += packet->chunks.size();
  measured.chunks_kept += packet->manifest.size() - packet->chunks.size();
  last_packet_ = *std::move(packet);
}

std::vector<std::byte> Pipeline::last_packet() const {
  return last_packet_ ? codec::encode_packet(*last_packet_) : std::vector<std::byte>{};
}

std::vector<std::byte> Pipeline::last_mesh() const {
  if (!last_packet_) return {};
  Packet packet = *last_packet_;
  packet.textures.clear(), packet.chunks.clear();
  for (const ChunkKey& key : packet.manifest)
    if (const auto chunk = mergers_.back()->find(key)) packet.chunks.push_back(*chunk);
  return codec::encode_packet(packet);
}

/// Every sensor, then every merger, children before parents.
void Pipeline::run_frame(std::vector<std::optional<Frame>> frames, Measured& measured,
                         const Progress& progress) {
  TimePoint now{};
  measured.receiving_ms.clear(), measured.alone_ms.clear(), measured.cost = {};
  measured.silent.clear();
  const int shown = measured.frames;
  const auto captured = Clock::now();
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    SensorNode& sensor = *sensors_[i];
    if (!frames[i]) {
      measured.silent.insert(sensor.id());
      continue;
    }
    progress(sensor.id());
    now = std::max(now, frames[i]->captured_at());
    const auto start = Clock::now();
    const double cpu_before = process_cpu_ms();
    const auto bytes = sense(sensor, *std::move(frames[i]), measured);
    measured.cost.sensors_cpu_ms += process_cpu_ms() - cpu_before;
    measured.alone_ms[sensor.id()] = ms_since(start);
    measured.node_ms[sensor.id()].push_back(measured.alone_ms[sensor.id()]);
    if (bytes)
      deliver(sensor.id(), *bytes, now, measured);
    else
      lose(sensor.id(), bytes.error(), measured);
  }
  for (const auto& merger : mergers_) {
    progress(merger->id());
    now += std::chrono::ceil<Duration>(
        std::chrono::duration<double, std::milli>(merger->config().deadline_ms));
    const auto is_silent = [&](const std::string& id) { return measured.silent.contains(id); };
    if (std::ranges::all_of(merger->config().inputs, is_silent))
      measured.silent.insert(merger->id());
    else
      run_merger(*merger, now, measured);
  }
  if (measured.frames > shown) measured.end_to_end_ms.push_back(ms_since(captured));
  measured.cost.critical_path_ms = critical_path_ms(measured.alone_ms);
  if (measured.listener->captured) measured.listener->captured(measured.frame, measured.cost);
}

Result<std::vector<std::byte>> Pipeline::sense(SensorNode& sensor, Frame frame,
                                               const Measured& measured) {
  const auto surface = sensor.reconstruct(std::move(frame));
  if (!surface) return surface.error();
  if (sensor.is_empty(*surface)) drops_.count(sensor.id(), sensor.no_surface(surface->frame));
  if (surface->began_anew && measured.listener->warned)
    measured.listener->warned(sensor.pushed(surface->frame));
  return sensor.code(*surface);
}

/// A node's frame came to nothing: what follows from that further on is not told.
void Pipeline::lose(const std::string& id, const Error& error, Measured& measured) {
  drops_.count(id, error);
  measured.silent.insert(id);
}

void Pipeline::run_merger(MergeNode& merger, TimePoint now, Measured& measured) {
  const auto start = Clock::now();
  const double cpu_before = process_cpu_ms();
  const auto gathered = merger.inputs().gather(now);
  if (!gathered) return lose(merger.id(), gathered.error(), measured);
  if (!*gathered) return lose(merger.id(), {Error::Cause::empty, "no live input"}, measured);
  const auto bytes = merger.merge(**gathered);
  if (const auto notice = merger.calibration().take_notice(); notice && measured.listener->warned)
    measured.listener->warned(merger.id() + ": " + *notice);
  measured.cost.mergers_cpu_ms += process_cpu_ms() - cpu_before;
  const double alone_ms = ms_since(start) + measured.receiving_ms[merger.id()];
  measured.alone_ms[merger.id()] = alone_ms;
  if (!merger.reused())  // a frame in which nothing moved would flatter the figures
    measured.node_ms[merger.id()].push_back(alone_ms);
  if (bytes) return deliver(merger.id(), *bytes, now, measured);
  lose(merger.id(), bytes.error(), measured);
  merger.inputs().ask_key_frames();
}

Result<RunReport> Pipeline::run(int frames, const RunListener& listener) {
  const auto tell = [&](const std::string& place, const Error& error) {
    if (listener.dropped) listener.dropped(place + ": " + error.message);
  };
  drops_.set_listener(tell);
  for (const auto& merger : mergers_) merger->inputs().set_drop_listener(tell);

  Measured measured;
  measured.listener = &listener;
  if (listener.drawing)
    mergers_.back()->set_drawing_listener(
        [&](const RootAtlas::Drawing& drawing) { listener.drawing(measured.frame, drawing); });
  const auto start = Clock::now();
  std::vector<std::optional<Frame>> captured;
  for (measured.frame = 0; measured.frame < frames && capture(captured); ++measured.frame)
    run_frame(std::move(captured), measured, [&](const std::string& node) {
      if (listener.progress) listener.progress(measured.frame, frames, node);
    });
  drops_.set_listener({});
  mergers_.back()->set_drawing_listener({});
  for (const auto& merger : mergers_) merger->inputs().set_drop_listener({});
  if (!measured.any_surface)
    return Error{Error::Cause::empty, "scene '" + scene_->id +
                                          "': no frame with a surface came through (" +
                                          std::to_string(all_drops().size()) + " causes of drops)"};
  return report(measured, ms_since(start) / 1000);
}

std::map<std::string, std::uint64_t> Pipeline::all_drops() const {
  std::map<std::string, std::uint64_t> all = drops_.by_cause();
  for (const auto& merger : mergers_)
    for (const auto& [cause, n] : merger->inputs().drops().by_cause()) all[cause] += n;
  return all;
}

/// The slowest node of each layer of the tree, summed over the layers.
double Pipeline::critical_path_ms(const std::map<std::string, double>& node_ms) const {
  std::map<std::string, int> layer;
  std::map<int, double> slowest;
  const auto note = [&](const std::string& id, int l) {
    layer[id] = l;
    const auto ms = node_ms.find(id);
    if (ms != node_ms.end()) slowest[l] = std::max(slowest[l], ms->second);
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

/// What the slowest node could do with a machine of its own.
double Pipeline::throughput_fps(const Measured& measured) const {
  double slowest_ms = 0;
  for (const auto& [node, ms] : measured.node_ms)
    slowest_ms = std::max(slowest_ms, percentile(ms, 0.5));
  return slowest_ms > 0 ? 1000 / slowest_ms : 0;
}

RunReport Pipeline::report(const Measured& m, double seconds) const {
  RunReport r;
  r.scene = scene_->id;
  r.preset = preset_of(*scene_);
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
  r.drops = all_drops();
  r.last_frame = m.last_frame;
  const auto add = [](RunReport::Stages& all, const Trace& trace) {
    for (const auto& [stage, ms] : trace.stages())
      all[stage].insert(all[stage].end(), ms.begin(), ms.end());
  };
  for (const auto& sensor : sensors_) add(r.sensor_stages_ms, sensor->trace());
  for (const auto& merger : mergers_) {
    add(r.merge_stages_ms, merger->inputs().trace());
    add(r.merge_stages_ms, merger->trace());
  }
  for (const auto& merger : mergers_)
    for (const InputResidual& pair : merger->calibration().residuals()) r.pairs.push_back(pair);
  std::map<std::string, double> usual_ms;
  for (const auto& [node, ms] : m.node_ms) usual_ms[node] = percentile(ms, 0.5);
  r.critical_path_ms = critical_path_ms(usual_ms);
  r.throughput_fps = throughput_fps(m);
  r.end_to_end_ms = m.end_to_end_ms;
  return r;
}

}  // namespace mr::node
