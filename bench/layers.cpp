#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <thread>

#include "mr/core/parallel.h"
#include "mr/core/trace.h"
#include "mr/node/sources.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/synth/room.h"
#include "race.h"
#include "report.h"
#include "scene_input.h"
#include "stage.h"

/// The saving by keeping the still surface (docs/layers.md): the whole pipeline with layers is
/// compared with the same scene reconstructed from every capture.
namespace mr::bench {
namespace {

const std::string kEverything = "everything";
constexpr int kLearn = 100, kMeasured = 60, kMeasuredAnew = 20;  // captures
constexpr auto kPatienceForScenes = std::chrono::hours(4);

std::filesystem::path scene_of_case(const std::string& name) {
  return std::filesystem::path(MR_SOURCE_DIR) / "bench" / "scenes" / (name + ".yaml");
}

std::vector<CaseInfo> layers_cases() {
  std::vector<CaseInfo> out{
      {"still", "an office after hours, four sensors: nothing moves", true, ""},
      {"two_people", "the demo's room at 1 cm, four sensors", true, ""},
      {"crowd", "a hall with six people, six sensors", true, ""}};
  for (CaseInfo& c : out)
    if (!std::filesystem::exists(scene_of_case(c.name)))
      c.missing = "needs " + scene_of_case(c.name).string();
  return out;
}

// -------------------------------------------------- in a child

/// Renders what will be read into the cache, so that contenders only read it.
Message render(const std::filesystem::path& file) {
  const Scene scene = load_or_throw(file);
  const std::vector<SensorId> all = all_sensors(scene.sensors);
  Message about{{"sensors", all.size()}, {"voxel_m", scene.voxel_m}, {"fps", scene.fps}};
  about["depth"] = {scene.sensors.front().depth_camera.width,
                    scene.sensors.front().depth_camera.height};
  if (scene.rig) about["people"] = scene.rig->people;
  Arena(0).run([&] {
    const auto sources = node::open_sources(scene, all, synth::default_rig_cache());
    for (int i = 0; scene.rig && i < kLearn + kMeasured; ++i)
      for (const auto& source : sources) static_cast<void>(source->next().ok());
  });
  return about;
}

/// What some captures took.
class Costs {
 public:
  void add(const runtime::CaptureCost& cost) { all_.push_back(cost); }
  bool empty() const { return all_.empty(); }

  template <typename Value>
  std::vector<double> each(const Value& value) const {
    std::vector<double> out;
    for (const runtime::CaptureCost& cost : all_) out.push_back(static_cast<double>(value(cost)));
    return out;
  }
  template <typename Value>
  double sum(const Value& value) const {
    const std::vector<double> values = each(value);
    return std::accumulate(values.begin(), values.end(), 0.0);
  }
  template <typename Value>
  double mean(const Value& value) const {
    return sum(value) / static_cast<double>(all_.size());
  }

 private:
  std::vector<runtime::CaptureCost> all_;
};

double cpu_ms(const runtime::CaptureCost& cost) {
  return cost.sensors_cpu_ms + cost.mergers_cpu_ms;
}
std::uint64_t all_bytes(const runtime::CaptureCost& cost) {
  return cost.mesh_bytes + cost.head_bytes + cost.texture_bytes;
}

/// Fields of a result. Work and bytes come in bursts: means, not medians.
Message fields_of(const Costs& costs) {
  using Cost = runtime::CaptureCost;
  return {
      {"ms", rounded(costs.mean(cpu_ms), 3)},
      {"p95_ms", rounded(percentile(costs.each(cpu_ms), 0.95), 3)},
      {"runs", costs.each(cpu_ms).size()},
      {"nodes",
       {{"sensor", rounded(costs.mean([](const Cost& c) { return c.sensors_cpu_ms; }), 3)},
        {"merge", rounded(costs.mean([](const Cost& c) { return c.mergers_cpu_ms; }), 3)}}},
      {"mesh_bytes", rounded(costs.mean([](const Cost& c) { return c.mesh_bytes; }), 1)},
      {"head_bytes", rounded(costs.mean([](const Cost& c) { return c.head_bytes; }), 1)},
      {"texture_bytes", rounded(costs.mean([](const Cost& c) { return c.texture_bytes; }), 1)},
      {"critical_path_ms",
       rounded(percentile(costs.each([](const Cost& c) { return c.critical_path_ms; }), 0.5), 3)}};
}

/// Runs a scene on all threads: `before` captures from `first` on, then those that are measured.
Message run_layers(const std::filesystem::path& file, bool layers, int first, int before,
                   int measured) {
  Scene scene = load_or_throw(file);
  scene.still.layers = layers;
  Costs learning, steady;
  Arena(0).run([&] {
    const auto pipeline = runtime::LockstepScene::open(scene, synth::default_rig_cache());
    if (!pipeline) throw std::runtime_error(pipeline.error().message);
    (*pipeline)->skip(static_cast<std::uint64_t>(first));
    runtime::RunListener listener;
    listener.dropped =
        listener.warned = [](const std::string& message) { fmt::print(stderr, "{}\n", message); };
    listener.captured = [&](int i, const runtime::CaptureCost& cost) {
      (i < before ? learning : steady).add(cost);
    };
    if (const auto report = (*pipeline)->run(before + measured, listener); !report)
      throw std::runtime_error(report.error().message);
  });
  if (steady.empty()) throw std::runtime_error(file.string() + " holds too few captures");
  Message out = fields_of(steady);
  if (layers) out["learn_bytes"] = learning.sum(all_bytes);
  return out;
}

// -------------------------------------------------- the stage

/// How many times as much `everything` takes. Ours may need no byte at all: that counts as one.
void add_ratios(const std::string& name, const Message& ours, const Message& everything,
                Message& out) {
  const auto add = [&](const std::string& what, double of_theirs, double of_ours) {
    out[fmt::format("{}/{}/{}", kEverything, name, what)] =
        rounded(of_theirs / std::max(of_ours, 1.0), 2);
  };
  const auto number = [](const Message& row, const char* field) {
    return row.at(field).get<double>();
  };
  for (const char* field : {"ms", "mesh_bytes", "texture_bytes", "critical_path_ms"})
    add(field, number(everything, field), number(ours, field));
  add("mesh_and_head_bytes", number(everything, "mesh_bytes") + number(everything, "head_bytes"),
      number(ours, "mesh_bytes") + number(ours, "head_bytes"));
}

Status measure_layers_case(const std::string& name, const std::filesystem::path& file,
                           cli::ProgressBar& bar, Report& report) {
  bar.show(name + ": rendering", 0, 3);
  const auto about = apart([&] { return render(file); }, kPatienceForScenes);
  if (!about) return about.error();
  report.input[name] = *about;
  bar.show(name + ": ours", 1, 3);
  const auto ours =
      apart([&] { return run_layers(file, true, 0, kLearn, kMeasured); }, kPatienceForScenes);
  if (!ours) return ours.error();
  bar.show(name + ": " + kEverything, 2, 3);
  // The same part of the recording; the first capture is a key frame, and left out.
  const auto everything = apart(
      [&] { return run_layers(file, false, kLearn - 1, 1, kMeasuredAnew); }, kPatienceForScenes);
  if (!everything) return everything.error();
  for (const auto& [impl, fields] :
       {std::pair(kOurs, &*ours), std::pair(kEverything, &*everything)}) {
    Message row{{"impl", impl}, {"threads", std::thread::hardware_concurrency()}, {"case", name}};
    row.update(*fields);
    report.results.push_back(std::move(row));
  }
  add_ratios(name, *ours, *everything, report.ratio);
  return {};
}

Result<Report> run_layers_stage(const Request& request, cli::ProgressBar& bar) {
  Report report{.stage = "layers",
                .columns = {{"mesh B", "mesh_bytes", 0},
                            {"head B", "head_bytes", 0},
                            {"texture B", "texture_bytes", 0},
                            {"learn B", "learn_bytes", 0},
                            {"path ms", "critical_path_ms", 1}},
                .ratio = Message::object()};
  if (!request.input.empty()) {
    if (!request.cases.empty())
      return Error{Error::Cause::invalid,
                   "layers takes a scene as a whole: no --case with --input"};
    const Status measured =
        measure_layers_case(request.input.stem().string(), request.input, bar, report);
    if (!measured) return measured.error();
    return report;
  }
  const auto names = wanted_cases(layers_cases(), request, "layers has");
  if (!names) return names.error();
  for (const std::string& name : *names)
    if (const Status measured = measure_layers_case(name, scene_of_case(name), bar, report);
        !measured)
      return measured.error();
  return report;
}

}  // namespace

Stage layers_stage() {
  return {"layers",
          "the whole pipeline with layers beside `everything`, which makes all anew; processor "
          "time and bytes a capture, always on all threads",
          layers_cases, run_layers_stage};
}

}  // namespace mr::bench
