#include "mr/runtime/lockstep_scene.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <set>
#include <utility>

#include "mr/codec/packet_codec.h"
#include "mr/core/assert.h"
#include "mr/kit/topology.h"
#include "mr/node/sources.h"
#include "mr/rate/models.h"

namespace mr::runtime {
namespace {

using SteadyClock = std::chrono::steady_clock;

double ms_since(SteadyClock::time_point start) {
  return std::chrono::duration<double, std::milli>(SteadyClock::now() - start).count();
}

/// Adds the wall-clock and CPU time of a scope, on all threads, to two sums.
class Meter {
 public:
  Meter(double& wall_ms, double& cpu_ms) : wall_ms_(wall_ms), cpu_ms_(cpu_ms) {}
  ~Meter() {
    wall_ms_ += ms_since(start_);
    cpu_ms_ += process_cpu_ms() - cpu_before_;
  }
  Meter(const Meter&) = delete;
  Meter& operator=(const Meter&) = delete;

 private:
  double &wall_ms_, &cpu_ms_;
  SteadyClock::time_point start_ = SteadyClock::now();
  double cpu_before_ = process_cpu_ms();
};

}  // namespace

/// The input of a sensor's task: the frame of the current capture, an error, or the end.
class LockstepScene::GivenFrame final : public node::FrameInput {
 public:
  bool is_ready(TimePoint) override { return true; }
  std::optional<TimePoint> due() const override { return std::nullopt; }
  Result<std::optional<Captured>> next(TimePoint, const Watch&) override {
    auto given = std::exchange(frame, std::optional<Frame>());
    if (!given) return given.error();
    if (!*given) return std::optional<Captured>();
    const TimePoint read_at = (*given)->exposure_end;
    return std::optional(Captured{**std::move(given), read_at});
  }
  std::uint64_t skipped() const override { return 0; }

  Result<std::optional<Frame>> frame = std::optional<Frame>();
};

/// The sums of one run.
struct LockstepScene::Measured {
  int frame = 0;   // current
  int frames = 0;  // that reached the client
  bool any_surface = false;
  int last_frame = -1;  // the newest of them
  std::uint64_t mesh_bytes = 0, texture_bytes = 0, chunks_new = 0, chunks_kept = 0;
  std::vector<double> end_to_end_ms;
  std::map<std::string, std::vector<double>> node_ms;  // per frame: receiving and processing
  // Of the current frame:
  std::map<std::string, double> alone_ms;  // all of a node's work
  CaptureCost cost;
  std::set<std::string> silent;  // nodes without a packet; losses are reported elsewhere
};

// -------------------------------------------------- opening

Result<std::unique_ptr<LockstepScene>> LockstepScene::open(
    Scene given, const std::filesystem::path& cache_folder) {
  auto scene = node::prepare_scene(std::move(given));
  if (!scene) return scene.error();
  auto background = node::open_background(*scene);
  if (!background) return background.error();
  std::string unusable;
  auto model = rate::open_model(scene->rate, [&](const std::string& why) { unusable = why; });
  if (!model) return model.error();
  std::unique_ptr<LockstepScene> out(new LockstepScene(std::make_unique<Scene>(*std::move(scene)),
                                                       *std::move(background), *std::move(model),
                                                       cache_folder));
  out->model_unusable_ = std::move(unusable);
  return out;
}

LockstepScene::LockstepScene(std::unique_ptr<Scene> scene, std::vector<EncodedChunk> background,
                             std::shared_ptr<const rate::Model> rate_model,
                             const std::filesystem::path& cache_folder)
    : scene_(std::move(scene)), transport_(net::make_in_process_transport()) {
  drops_.set_listener(log_of("").dropped);
  const std::vector<SensorId> all = all_sensors(scene_->sensors);
  sources_ = node::open_sources(*scene_, all, cache_folder);
  for (const SensorId id : all) {
    auto frame = std::make_unique<GivenFrame>();
    frames_.push_back(frame.get());
    sensors_.push_back(member(std::make_unique<node::SensorTask>(*scene_, id, std::move(frame),
                                                                 log_of(scene_->sensor(id).id))));
  }
  for (const MergerConfig& merger : scene_->mergers) {
    const bool is_root = &merger == &scene_->mergers.back();
    node::MergeTask::Options options;
    if (is_root) options.background = std::move(background), options.rate_model = rate_model;
    mergers_.push_back(member(
        std::make_unique<node::MergeTask>(*scene_, merger, log_of(merger.id), std::move(options))));
  }
  client_ = member(std::make_unique<node::ClientTask>(*scene_, log_of("client")));
}

LockstepScene::~LockstepScene() = default;

node::NodeLog LockstepScene::log_of(const std::string& id) {
  return {.write =
              [this, id](LogLevel level, const std::string& text) {
                if (level != LogLevel::info && listener_ && listener_->warned)
                  listener_->warned(id + ": " + text);
              },
          .dropped =
              [this](const std::string& place, const Error& error) {
                if (listener_ && listener_->dropped)
                  listener_->dropped(place + ": " + error.message);
              }};
}

template <typename T>
LockstepScene::Member<T> LockstepScene::member(std::unique_ptr<T> task) {
  auto steps = std::make_unique<TaskSteps>(
      *task, *transport_, [this] { return now_; }, drops_);
  return {std::move(task), std::move(steps)};
}

// -------------------------------------------------- running

void LockstepScene::skip(std::uint64_t frames) {
  for (const auto& source : sources_) source->skip(frames);
}

Status LockstepScene::learn(int frames) {
  for (int i = 0; i < frames; ++i)
    for (std::size_t s = 0; s < sources_.size(); ++s) {
      auto frame = sources_[s]->next();
      if (!frame) return frame.error();
      if (*frame) sensors_[s].task->node().learn(**std::move(frame));
    }
  return {};
}

Result<std::vector<LockstepScene::Capture>> LockstepScene::read(int frames) {
  std::vector<Capture> out;
  for (int i = 0; i < frames; ++i) {
    Capture capture;
    bool any = false;
    for (const auto& source : sources_) {
      auto frame = source->next();
      if (!frame) return frame.error();
      any |= frame->has_value();
      capture.push_back(*std::move(frame));
    }
    if (!any) break;
    out.push_back(std::move(capture));
  }
  return out;
}

LockstepScene::Memory LockstepScene::memory() const {
  Memory out;
  for (const auto& sensor : sensors_) out.sensors.push_back(sensor.task->node().memory());
  out.root = root().node().atlas().memory();
  return out;
}

void LockstepScene::recall(const Memory& memory) {
  MR_ASSERT(memory.sensors.size() == sensors_.size());
  for (std::size_t i = 0; i < sensors_.size(); ++i)
    if (memory.sensors[i]) sensors_[i].task->node().recall(*memory.sensors[i]);
  root().node().atlas().recall(memory.root);
}

void LockstepScene::ask_key_frames(std::vector<StreamId> streams) {
  root().answer({std::move(streams), {}, {}}, now_);
}

Status LockstepScene::set_plan(const ScenePlan& plan) {
  const auto control = codec::plan_control(plan);
  if (!control) return control.error();
  root().answer(*control, now_);
  return {};
}

void LockstepScene::set_target(double mbps) {
  codec::Control control;
  control.target_mbps = mbps;
  root().answer(control, now_);
}

Result<RunReport> LockstepScene::run(int frames, const RunListener& listener) {
  return run(
      frames, [this](int) { return capture(); }, listener);
}

Result<RunReport> LockstepScene::run(std::span<const Capture> captures,
                                     const RunListener& listener) {
  TimePoint first = TimePoint::max();
  for (const Capture& capture : captures)
    for (const auto& frame : capture)
      if (frame) first = std::min(first, frame->captured_at());
  const Duration period(std::llround(1e9 / scene_->fps));
  const Duration later = last_capture_ - first + period;
  return run(
      static_cast<int>(captures.size()),
      [&](int i) { return give(captures[static_cast<std::size_t>(i)], later); }, listener);
}

Result<RunReport> LockstepScene::run(int frames, const std::function<bool(int)>& capture,
                                     const RunListener& listener) {
  listener_ = &listener;
  if (listener.warned && !model_unusable_.empty())
    listener.warned(std::exchange(model_unusable_, std::string()));
  Measured measured;
  if (listener.drawing)
    root().node().set_drawing_listener([&](const node::RootAtlas::Drawing& drawing) {
      listener.drawing(measured.frame, drawing);
    });
  const auto start = SteadyClock::now();
  for (measured.frame = 0; measured.frame < frames && capture(measured.frame); ++measured.frame)
    run_frame(measured, [&](const std::string& node) {
      if (listener.progress) listener.progress(measured.frame, frames, node);
    });
  listener_ = nullptr;
  root().node().set_drawing_listener({});
  if (!measured.any_surface)
    return Error{Error::Cause::empty, "scene '" + scene_->id +
                                          "': no frame with a surface came through (" +
                                          std::to_string(all_drops().size()) + " causes of drops)"};
  return report(measured, ms_since(start) / 1000);
}

/// One frame of every source; false when all have ended.
bool LockstepScene::capture() {
  bool any = false;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    frames_[i]->frame = sources_[i]->next();
    if (sources_[i]->is_live()) lay_on_scene(frames_[i]->frame);
    any |= !frames_[i]->frame || frames_[i]->frame->has_value();
  }
  return any;
}

/// These frames, that much later; false when there is none.
bool LockstepScene::give(const Capture& capture, Duration later) {
  MR_ASSERT(capture.size() == frames_.size());
  bool any = false;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    std::optional<Frame> frame = capture[i];
    if (frame) frame->exposure_start += later, frame->exposure_end += later;
    any |= frame.has_value();
    frames_[i]->frame = std::move(frame);
  }
  return any;
}

/// Devices tell the time of day: the scene begins with their first frame.
void LockstepScene::lay_on_scene(Result<std::optional<Frame>>& captured) {
  if (!captured || !*captured) return;
  Frame& frame = **captured;
  if (!live_start_) live_start_ = frame.captured_at();
  frame.exposure_start -= live_start_->time_since_epoch();
  frame.exposure_end -= live_start_->time_since_epoch();
}

/// Every sensor, then every merger, children before parents, then the client.
void LockstepScene::run_frame(Measured& measured,
                              const std::function<void(const std::string&)>& progress) {
  measured.alone_ms.clear(), measured.cost = {}, measured.silent.clear();
  const int shown = measured.frames;
  const auto captured = SteadyClock::now();
  now_ = {};
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    const auto& frame = frames_[i]->frame;
    if (frame && *frame) {
      progress(sensors_[i].task->id());
      now_ = std::max(now_, (*frame)->captured_at());
      last_capture_ = std::max(last_capture_, now_);
    }
    run_sensor(i, measured);
  }
  for (auto& merger : mergers_) {
    progress(merger.task->id());
    run_merger(merger, measured);
  }
  if (!measured.silent.contains(root().id())) show(measured);
  if (measured.frames > shown) measured.end_to_end_ms.push_back(ms_since(captured));
  measured.cost.critical_path_ms = critical_path_ms(measured.alone_ms);
  if (listener_->captured) listener_->captured(measured.frame, measured.cost);
}

void LockstepScene::run_sensor(std::size_t sensor, Measured& measured) {
  node::SensorTask& task = *sensors_[sensor].task;
  const auto& frame = frames_[sensor]->frame;
  const bool is_there = frame && *frame;
  {
    double unmeasured = 0;
    const Meter meter(is_there ? measured.alone_ms[task.id()] : unmeasured,
                      measured.cost.sensors_cpu_ms);
    make_packet(task, *sensors_[sensor].steps, measured);
  }
  if (is_there) measured.node_ms[task.id()].push_back(measured.alone_ms[task.id()]);
}

/// A merger of which no input has a packet is skipped without a report.
void LockstepScene::run_merger(Member<node::MergeTask>& merger, Measured& measured) {
  node::MergeTask& task = *merger.task;
  const auto is_silent = [&](const std::string& id) { return measured.silent.contains(id); };
  const bool works = !std::ranges::all_of(task.inputs(), is_silent);
  if (works) {
    const Meter meter(measured.alone_ms[task.id()], measured.cost.mergers_cpu_ms);
    merger.steps->step(now_);
  }
  now_ += std::chrono::ceil<Duration>(
      std::chrono::duration<double, std::milli>(task.node().config().deadline_ms));
  if (!works) {
    measured.silent.insert(task.id());
    return;
  }
  if (!task.is_ready(now_)) drops_.count(task.id(), {Error::Cause::empty, "no live input"});
  {
    const Meter meter(measured.alone_ms[task.id()], measured.cost.mergers_cpu_ms);
    make_packet(task, *merger.steps, measured);
  }
  const bool came_to_nothing = measured.silent.contains(task.id());
  if (!came_to_nothing &&
      !task.node().reused())  // captures without motion would distort the figures
    measured.node_ms[task.id()].push_back(measured.alone_ms[task.id()]);
}

void LockstepScene::make_packet(const node::Task& task, TaskSteps& steps, Measured& measured) {
  const net::Message packet = steps.make_packet(now_);
  if (!packet) {
    measured.silent.insert(task.id());
  } else if (&task == &root()) {
    root_bytes_ = packet->size();
    if (listener_->packet) listener_->packet(measured.frame, *packet);
  }
}

/// The client's side: decodes what the root sent.
void LockstepScene::show(Measured& measured) {
  client_.steps->step(now_);
  const auto& packet = client_.task->newest();
  if (!packet || packet->sequence == shown_) return;  // refused, which was reported
  auto scene = client_.task->scene();
  if (!scene) return drops_.count("client", {Error::Cause::empty, "a frame stayed incomplete"});
  measured.any_surface |= !scene->chunks.empty();
  decoded_ = *std::move(scene);
  shown_ = packet->sequence;
  ++measured.frames;
  measured.last_frame = measured.frame;
  count_bytes(*packet, root_bytes_, measured);
  if (listener_->shown) listener_->shown(measured.frame, *decoded_);
}

void LockstepScene::count_bytes(const Packet& packet, std::uint64_t bytes,
                                Measured& measured) const {
  CaptureCost& cost = measured.cost;
  cost.shown = true, cost.plan = packet.plan;
  for (const TextureUnit& unit : packet.textures) {
    cost.texture_bytes += unit.data.size();
    if (unit.stream == node::RootAtlas::kPlateStream) cost.plate_bytes += unit.data.size();
    cost.key_frame |= unit.key_frame;
  }
  for (const EncodedChunk& chunk : packet.chunks) {
    cost.mesh_bytes += chunk.payload.size();
    if (chunk.key.id.layer == Layer::still) cost.still_bytes += chunk.payload.size();
  }
  for (const AlphaPlane& alpha : packet.alpha) cost.alpha_bytes += alpha.data.size();
  cost.head_bytes = bytes - cost.texture_bytes - cost.mesh_bytes;
  measured.texture_bytes += cost.texture_bytes;
  measured.mesh_bytes += bytes - cost.texture_bytes;
  measured.chunks_new += packet.chunks.size();
  measured.chunks_kept += packet.manifest.size() - packet.chunks.size();
  if (listener_->sent)
    listener_->sent(measured.frame, bytes - cost.texture_bytes, cost.texture_bytes);
}

// -------------------------------------------------- results

std::vector<std::byte> LockstepScene::last_packet() const {
  const auto& packet = client_.task->newest();
  return packet ? codec::encode_packet(*packet) : std::vector<std::byte>{};
}

std::vector<std::byte> LockstepScene::last_mesh() const {
  if (!client_.task->newest()) return {};
  Packet packet = *client_.task->newest();
  packet.textures.clear(), packet.chunks.clear();
  for (const ChunkKey& key : packet.manifest)
    if (const auto chunk = root().node().find(key)) packet.chunks.push_back(*chunk);
  return codec::encode_packet(packet);
}

std::map<std::string, std::uint64_t> LockstepScene::all_drops() const {
  std::map<std::string, std::uint64_t> all = drops_.by_cause();
  const auto add = [&](const node::Task& task) {
    for (const auto& [cause, n] : task.stats(now_).drops) all[cause] += n;
  };
  for (const auto& sensor : sensors_) add(*sensor.task);
  for (const auto& merger : mergers_) add(*merger.task);
  add(*client_.task);
  return all;
}

/// The slowest node of each layer of the tree, summed over the layers.
double LockstepScene::critical_path_ms(const std::map<std::string, double>& node_ms) const {
  std::map<std::string, int> layer;
  std::map<int, double> slowest;
  const auto note = [&](const std::string& id, int l) {
    layer[id] = l;
    const auto ms = node_ms.find(id);
    if (ms != node_ms.end()) slowest[l] = std::max(slowest[l], ms->second);
  };
  for (const auto& sensor : sensors_) note(sensor.task->id(), 0);
  for (const auto& merger : mergers_) {
    int below = 0;
    for (const std::string& input : merger.task->inputs()) below = std::max(below, layer[input]);
    note(merger.task->id(), below + 1);
  }
  double sum = 0;
  for (const auto& [l, ms] : slowest) sum += ms;
  return sum;
}

/// Frame rate of the slowest node, if each node ran on a machine of its own.
double LockstepScene::throughput_fps(const Measured& measured) const {
  double slowest_ms = 0;
  for (const auto& [node, ms] : measured.node_ms)
    slowest_ms = std::max(slowest_ms, percentile(ms, 0.5));
  return slowest_ms > 0 ? 1000 / slowest_ms : 0;
}

RunReport LockstepScene::report(const Measured& m, double seconds) const {
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
    if (const auto coded = root().node().find(chunk->key)) r.refresh_bytes += coded->payload.size();
  r.chunks_new = m.chunks_new, r.chunks_kept = m.chunks_kept;
  r.drops = all_drops();
  r.last_frame = m.last_frame;
  const auto add = [](RunReport::Stages& all, const Trace& trace) {
    for (const auto& [stage, ms] : trace.stages())
      all[stage].insert(all[stage].end(), ms.begin(), ms.end());
  };
  for (const auto& sensor : sensors_) add(r.sensor_stages_ms, sensor.task->trace());
  for (const auto& merger : mergers_) {
    node::MergeNode& node = merger.task->node();
    add(r.merge_stages_ms, node.inputs().trace());
    add(r.merge_stages_ms, node.trace());
    for (const node::InputResidual& pair : node.calibration().residuals()) r.pairs.push_back(pair);
  }
  r.colors = root().node().colors(), r.misplaced_px = root().node().misplaced_px();
  std::map<std::string, double> usual_ms;
  for (const auto& [node, ms] : m.node_ms) usual_ms[node] = percentile(ms, 0.5);
  r.critical_path_ms = critical_path_ms(usual_ms);
  r.throughput_fps = throughput_fps(m);
  r.end_to_end_ms = m.end_to_end_ms;
  return r;
}

}  // namespace mr::runtime
