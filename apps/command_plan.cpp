#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "mr/cli/progress.h"
#include "mr/core/file.h"
#include "mr/core/parallel.h"
#include "mr/node/sources.h"
#include "mr/planner/planner.h"
#include "mr/planner/scene_text.h"
#include "mr/synth/room.h"
#include "output.h"

namespace mr::apps {
namespace {

struct PlanOptions {
  std::filesystem::path scene, write;
  std::vector<std::string> set;
  planner::PlanConfig config;
  std::string split = "auto";
  bool no_frames = false, fragment = false, json = false;
  int threads = 0;
};

/// What the plan was made from, and the plan.
struct Outcome {
  std::vector<planner::SensorSample> samples;
  planner::MergeCosts costs;
  planner::Plan plan;
  int threads = 1;
  std::string looked;  ///< at what
};

double triangles_of(const Outcome& outcome) {
  double sum = 0;
  for (const planner::SensorSample& sample : outcome.samples) sum += sample.triangles;
  return sum;
}

Result<Outcome> make(const Scene& scene, const PlanOptions& options) {
  Outcome out;
  cli::ProgressBar bar;
  out.samples.resize(scene.sensors.size());
  out.looked = "10,000 each, in all of their frusta";
  if (!options.no_frames) {
    planner::SampleConfig config;
    config.progress = [&](std::size_t done, std::size_t of) { bar.show("sensors", done, of); };
    config.notice = [&](const std::string& line) { bar.say("note: " + line); };
    out.samples = planner::sample_sensors(scene, synth::default_rig_cache(), config);
    out.looked = scene.sensors.size() <= static_cast<std::size_t>(config.most_sensors)
                     ? "in one frame of each"
                     : fmt::format("the mean of {}, in all of their frusta",
                                   planner::SampleConfig::kSamples);
  }
  out.costs = planner::measure_merge_costs(
      scene, triangles_of(out) / static_cast<double>(out.samples.size()));
  auto plan = planner::make_plan(scene, out.samples, out.costs, options.config);
  if (!plan) return plan.error();
  out.plan = *std::move(plan);
  return out;
}

nlohmann::ordered_json as_json(const planner::PlannedMerger& merger) {
  nlohmann::ordered_json out{{"id", merger.config.id},
                             {"layer", merger.layer},
                             {"inputs", merger.config.inputs},
                             {"deadline_ms", merger.config.deadline_ms},
                             {"triangles_in", merger.triangles_in},
                             {"triangles_shared", merger.triangles_shared},
                             {"triangles_out", merger.triangles_out},
                             {"latency_ms", merger.latency_ms},
                             {"memory_mb", merger.memory_mb}};
  if (const auto& region = merger.config.region)
    out["region"] = {{region->low.x, region->low.y, region->low.z},
                     {region->high.x, region->high.y, region->high.z}};
  return out;
}

nlohmann::ordered_json as_json(const Scene& scene, const Outcome& outcome) {
  const auto& [samples, costs, plan, threads, looked] = outcome;
  nlohmann::ordered_json out{{"scene", scene.id},
                             {"sensors", scene.sensors.size()},
                             {"threads", threads},
                             {"triangles", triangles_of(outcome)},
                             {"triangles_from", looked},
                             {"costs",
                              {{"decode_ns", costs.decode_ns},
                               {"merge_ns", costs.merge_ns},
                               {"overlap_ns", costs.overlap_ns},
                               {"code_ns", costs.code_ns},
                               {"memory_bytes", costs.memory_bytes},
                               {"coded_bytes", costs.coded_bytes}}},
                             {"split", plan.split == planner::Split::space ? "space" : "sensors"},
                             {"why", plan.why},
                             {"layers", plan.layers},
                             {"latency_ms", plan.latency_ms},
                             {"links_ms", plan.links_ms},
                             {"mergers", nlohmann::ordered_json::array()}};
  for (const planner::PlannedMerger& merger : plan.mergers)
    out["mergers"].push_back(as_json(merger));
  out["central"] = as_json(plan.central);
  out["central"]["tree_latency_ms"] = plan.central_latency_ms;
  const planner::GridEstimate& grid = plan.one_grid;
  out["one_grid"] = {{"blocks", grid.blocks},
                     {"memory_mb", grid.memory_mb},
                     {"dense_memory_mb", grid.dense_memory_mb}};
  if (grid.reconstruct_ms > 0) out["one_grid"]["reconstruct_ms"] = grid.reconstruct_ms;
  return out;
}

/// 12345.6 → "12,346".
std::string whole(double number) {
  std::string digits = fmt::format("{:.0f}", number);
  for (std::ptrdiff_t at = std::ssize(digits) - 3; at > 0; at -= 3)
    digits.insert(static_cast<std::size_t>(at), ",");
  return digits;
}

std::string inputs_of(const MergerConfig& merger) {
  constexpr std::size_t kMost = 4;
  if (merger.inputs.size() <= kMost) return fmt::format("{}", fmt::join(merger.inputs, " "));
  return fmt::format("{} {} … {} ({})", merger.inputs[0], merger.inputs[1], merger.inputs.back(),
                     merger.inputs.size());
}

/// Columns as wide as their widest cell; all but the first two are numbers.
std::string table(const std::vector<std::vector<std::string>>& rows) {
  const auto letters = [](const std::string& text) {  // of UTF-8
    return std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; });
  };
  std::vector<std::ptrdiff_t> widths(rows.front().size(), 0);
  for (const auto& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i)
      widths[i] = std::max<std::ptrdiff_t>(widths[i], letters(row[i]));
  std::string out;
  for (const auto& row : rows) {
    std::string line = " ";
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string space(static_cast<std::size_t>(widths[i] - letters(row[i])), ' ');
      line += " " + (i < 2 ? row[i] + space : space + row[i]) + " ";
    }
    out += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  return out;
}

std::vector<std::string> row_of(const std::string& name, const planner::PlannedMerger& merger) {
  return {name,
          inputs_of(merger.config),
          whole(merger.triangles_in),
          whole(merger.triangles_shared),
          whole(merger.triangles_out),
          fmt::format("{:.1f}", merger.latency_ms),
          fmt::format("{:.1f}", merger.memory_mb)};
}

std::string as_text(const Scene& scene, const Outcome& outcome) {
  const auto& [samples, costs, plan, threads, looked] = outcome;
  std::string out = fmt::format(
      "scene {}: {} sensors, {} triangles a frame ({})\n"
      "this machine, {} threads, a triangle: decode {:.0f} ns, merge {:.0f} ns, {:.0f} ns more "
      "where several see it, code {:.0f} ns; {:.0f} bytes of memory\n"
      "split: {}\n\n",
      scene.id, samples.size(), whole(triangles_of(outcome)), looked, threads, costs.decode_ns,
      costs.merge_ns, costs.overlap_ns, costs.code_ns, costs.memory_bytes, plan.why);
  std::vector<std::vector<std::string>> rows{
      {"merger", "inputs", "triangles in", "shared", "out", "ms", "MB"}};
  for (const planner::PlannedMerger& merger : plan.mergers)
    rows.push_back(row_of(merger.config.id, merger));
  rows.push_back(row_of("one for all", plan.central));
  rows.back()[1] = fmt::format("all {} sensors", samples.size());
  out += table(rows);
  const planner::GridEstimate& grid = plan.one_grid;
  out += fmt::format(
      "\nthis tree: {:.1f} ms in {} layer{}, of which links {:.1f} ms, each machine alone with "
      "its merger; labels, pictures and the root's decimation are not counted in\n"
      "one merger for all: {:.1f} ms\n"
      "all depth in one grid (paper, 6.5): {:.0f} MB of voxels around surface, {:.1f} GB in a "
      "dense "
      "grid{}\n",
      plan.latency_ms, plan.layers, plan.layers == 1 ? "" : "s", plan.links_ms,
      plan.central_latency_ms, grid.memory_mb, grid.dense_memory_mb / 1000,
      grid.reconstruct_ms > 0
          ? fmt::format("; {:.0f} ms to reconstruct, if it costs what the sensors' nodes need",
                        grid.reconstruct_ms)
          : "");
  return out;
}

/// Writes the scene with the plan's mergers, if it is a scene then.
Status write(const PlanOptions& options, const planner::Plan& plan) {
  const std::string block = planner::mergers_block(plan);
  if (options.fragment) return write_file(options.write, block);
  const auto bytes = read_file(options.scene);
  if (!bytes) return bytes.error();
  const std::string text =
      planner::with_mergers({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, block);
  // Paths in it are relative to its folder, so it is checked where it will lie.
  std::filesystem::path draft = options.write;
  draft += ".draft";
  if (const Status written = write_file(draft, text); !written) return written;
  const SceneResult read = load_scene(draft);
  std::error_code failed;
  std::filesystem::remove(draft, failed);
  if (read.problems.empty()) return write_file(options.write, text);
  return Error{
      Error::Cause::invalid,
      fmt::format("{} would have {} problem{}, the first in line {}: {}; --fragment writes "
                  "the mergers alone",
                  options.write.string(), read.problems.size(),
                  read.problems.size() == 1 ? "" : "s", read.problems[0].line,
                  read.problems[0].message)};
}

int plan(const PlanOptions& given) {
  PlanOptions options = given;
  if (!options.write.empty() && !options.fragment && !options.set.empty())
    return fail(
        "--write copies the text of SCENE, which --set does not change: write the keys into "
        "it, or use --fragment");
  if (options.split != "auto")
    options.config.split =
        options.split == "space" ? planner::Split::space : planner::Split::sensors;
  const auto loaded = load_or_print_problems(options.scene, options.set);
  if (!loaded) return 1;
  const auto scene = node::prepare_scene(*loaded);
  if (!scene) return fail(scene.error().message);
  if (static_cast<std::size_t>(options.config.mergers) > scene->sensors.size())  // before the work
    return misuse(fmt::format("{} mergers are more than the scene's {} sensors",
                              options.config.mergers, scene->sensors.size()));
  std::optional<Result<Outcome>> outcome;
  Arena arena(options.threads > 0 ? options.threads : scene->threads);
  arena.run([&] { outcome.emplace(make(*scene, options)); });
  if (!*outcome) return fail(outcome->error().message);
  (*outcome)->threads = arena.threads();
  if (!options.write.empty())
    if (const Status written = write(options, (*outcome)->plan); !written)
      return fail(written.error().message);
  fmt::print("{}",
             options.json ? as_json(*scene, **outcome).dump(2) + "\n" : as_text(*scene, **outcome));
  return 0;
}

}  // namespace

void add_plan(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<PlanOptions>();
  CLI::App* command = app.add_subcommand(
      "plan", "Propose a tree of mergers for a scene, with the latency and memory of each");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  add_set_option(*command, options->set);
  command
      ->add_option("--mergers", options->config.mergers,
                   "Mergers below the root; 1: the root alone")
      ->check(CLI::Range(1, 255))
      ->required();
  command
      ->add_option("--split", options->split,
                   "Group sensors that see the same, or give each merger a box of space; auto: "
                   "what suits the scene")
      ->check(CLI::IsMember({"auto", "sensors", "space"}))
      ->capture_default_str();
  command
      ->add_option("--link-ms", options->config.link_ms,
                   "From one machine to the next; time for bytes comes on top where the scene's "
                   "links have a limit")
      ->check(CLI::Range(0.0, 10'000.0))
      ->capture_default_str();
  command->add_flag("--no-frames", options->no_frames,
                    "Do not open the sensors: 10,000 triangles each, anywhere in their frusta");
  CLI::Option* write = command->add_option("--write", options->write,
                                           "Write the scene with these mergers; lies best beside "
                                           "SCENE, as paths in it are relative");
  command
      ->add_flag("--fragment", options->fragment,
                 "With --write: the mergers alone, to be pasted into a scene")
      ->needs(write);
  command->add_flag("--json", options->json, "Print as JSON");
  command->add_option("--threads", options->threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command->footer(
      "Costs are measured on this machine, in about a second, and triangles in one frame of each\n"
      "sensor: run it on a machine like those that will merge.\n"
      "Examples:\n"
      "  meshreduce plan examples/synthetic-room.yaml --mergers 2\n"
      "  meshreduce plan examples/synthetic-room.yaml --mergers 2 --split space --write "
      "examples/planned.yaml\n"
      "  meshreduce plan building.yaml --mergers 20 --no-frames --json");
  command->callback([options, &exit_code] { exit_code = plan(*options); });
}

}  // namespace mr::apps
