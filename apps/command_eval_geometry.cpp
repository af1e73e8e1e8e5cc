#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "commands.h"
#include "eval_options.h"
#include "mr/baseline/monolithic.h"
#include "mr/baseline/run_baseline.h"
#include "mr/core/parallel.h"
#include "mr/eval/geometry_error.h"
#include "mr/eval/read_mesh.h"
#include "mr/eval/reference_surface.h"
#include "mr/eval/sensor_coverage.h"
#include "mr/node/sources.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/synth/room.h"
#include "output.h"

namespace mr::apps {
namespace {

struct GeometryOptions {
  std::vector<std::filesystem::path> inputs;
  std::vector<std::string> set;
  int frame = 0, threads = 0;
  bool decoded = false, json = false;
  std::string reference;  ///< empty: the scene's best
  double voxel_m = 0;     ///< 0: the scene's, or 1 cm

  bool compares_files() const { return inputs.size() == 2; }
};

struct PairResidual {
  std::string a, b;
  double residual_mm = 0;
};

struct Measured {
  std::string tested, reference;  ///< for people
  std::string reference_key;      ///< truth, monolithic, or a file
  eval::GeometryError error;
  std::vector<PairResidual> pairs;
  std::string note;  ///< what was left out; may be empty
};

// ---------------------------------------------------------------------------- what is measured

Result<Mesh> baseline_surface(const Scene& scene, const GeometryOptions& options) {
  const auto run = baseline::run_baseline(scene, 1, options.frame, printing_listener(),
                                          synth::default_rig_cache());
  if (!run) return run.error();
  return eval::shown_surface(run->last);
}

/// One frame's surface through all nodes.
Result<Mesh> tested_surface(const Scene& scene, const GeometryOptions& options) {
  if (scene.pipeline != "meshreduce") return baseline_surface(scene, options);
  auto pipeline = runtime::LockstepScene::open(scene, synth::default_rig_cache());
  if (!pipeline) return pipeline.error();
  (*pipeline)->skip(static_cast<std::uint64_t>(options.frame));
  const auto report = (*pipeline)->run(1, printing_listener());
  if (!report) return report.error();
  if (options.decoded) return eval::shown_surface(*(*pipeline)->decoded());
  auto surface = (*pipeline)->surface();
  if (!surface) return eval::no_such_capture(scene, options.frame);
  return *std::move(surface);
}

// ------------------------------------------------------------------------------- sensor by sensor

constexpr std::size_t kMostForAllPairs = 12;
constexpr std::size_t kNeighbours = 4;

using Pair = std::pair<std::size_t, std::size_t>;  // places in the capture, the lower one first

/// All pairs; of many sensors each with those that stand nearest.
std::vector<Pair> pairs_of(std::span<const Frame> capture) {
  std::vector<Pair> pairs;
  for (std::size_t a = 0; a < capture.size(); ++a) {
    std::vector<std::pair<double, std::size_t>> others;
    for (std::size_t b = 0; b < capture.size(); ++b)
      if (b != a)
        others.emplace_back(
            length(capture[a].T_world_depth.translation - capture[b].T_world_depth.translation), b);
    std::ranges::sort(others);
    if (capture.size() > kMostForAllPairs) others.resize(kNeighbours);
    for (const auto& [distance, b] : others) pairs.emplace_back(std::min(a, b), std::max(a, b));
  }
  std::ranges::sort(pairs);
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

/// How far each two sensors' own surfaces lie apart, where they share any.
std::vector<PairResidual> pair_residuals(const Scene& scene, std::span<const Frame> capture,
                                         double voxel_m) {
  const eval::GeometryConfig config{.voxel_m = voxel_m, .samples = 40'000};
  std::map<std::size_t, Mesh> surfaces;
  const auto surface = [&](std::size_t i) -> const Mesh& {
    const auto [at, is_new] = surfaces.try_emplace(i);
    if (is_new) at->second = baseline::fuse_all(scene, capture.subspan(i, 1), scene.voxel_m);
    return at->second;
  };
  std::vector<PairResidual> out;
  for (const auto& [a, b] : pairs_of(capture)) {
    surfaces.erase(surfaces.begin(), surfaces.lower_bound(a));  // pairs are in order
    const double residual = eval::residual_mm(surface(a), surface(b), config);
    if (residual >= 0)
      out.push_back(
          {scene.sensor(capture[a].sensor).id, scene.sensor(capture[b].sensor).id, residual});
  }
  return out;
}

// ------------------------------------------------------------------------------------- measuring

Result<Measured> measure_scene(const Scene& given, const GeometryOptions& options) {
  const bool has_truth = eval::has_true_surface(given);
  const bool truth = options.reference.empty() ? has_truth : options.reference == "truth";
  if (truth && !has_truth)
    return Error{Error::Cause::unsupported, "scene '" + given.id +
                                                "' has no truth: it has neither a rig nor a key "
                                                "'truth'; use --reference monolithic"};
  if (given.pipeline == "points")
    return Error{Error::Cause::unsupported,
                 "scene '" + given.id + "' shows points, which have no surface to measure"};
  const auto scene = node::prepare_scene(given);
  if (!scene) return scene.error();
  const auto capture =
      eval::read_capture(*scene, options.frame, synth::default_rig_cache(),
                         [](const std::string& line) { printing_listener().dropped(line); });
  if (!capture) return capture.error();
  const auto reference = truth ? eval::true_surface(*scene, options.frame)
                               : Result<Mesh>(baseline::fuse_all(*scene, *capture, 0.01));
  if (!reference) return reference.error();
  const auto tested = tested_surface(*scene, options);
  if (!tested) return tested.error();
  const double voxel_m = options.voxel_m > 0 ? options.voxel_m : scene->voxel_m;
  const auto error =
      eval::geometry_error(*tested, *reference, eval::delivered_frustums(*scene, *capture, truth),
                           {.voxel_m = voxel_m, .captured = eval::captured_half_spaces(*scene)});
  if (!error) return error.error();
  std::string note;
  if (capture->size() > kMostForAllPairs)
    note = fmt::format("of {} sensors each is paired with the {} nearest only", capture->size(),
                       kNeighbours);
  const bool is_decoded = options.decoded || scene->pipeline != "meshreduce";
  return Measured{fmt::format("{}, frame {}, {}", scene->id, options.frame,
                              is_decoded ? "as a client decodes it" : "merged, before coding"),
                  truth ? "the noiseless truth" : "all sensors in one 1 cm grid (monolithic)",
                  truth ? "truth" : "monolithic",
                  *error,
                  pair_residuals(*scene, *capture, voxel_m),
                  note};
}

Result<Measured> compare_files(const GeometryOptions& options) {
  const std::string a = options.inputs[0].string(), b = options.inputs[1].string();
  const auto tested = eval::read_ply(a), reference = eval::read_ply(b);
  if (!tested) return tested.error();
  if (!reference) return reference.error();
  const auto error = eval::geometry_error(
      *tested, *reference, {}, {.voxel_m = options.voxel_m > 0 ? options.voxel_m : 0.01});
  if (!error) return error.error();
  return Measured{a, b, b, *error, {}, {}};
}

// ---------------------------------------------------------------------------------------- telling

/// To the tenth of a micrometre, or of a millionth.
double rounded(double value) { return std::round(value * 1e4) / 1e4; }
double rounded_ratio(double value) { return std::round(value * 1e7) / 1e7; }

nlohmann::ordered_json as_json(const eval::SurfaceDistance& d) {
  return {{"mean_mm", rounded(d.mean_mm)},
          {"rms_mm", rounded(d.rms_mm)},
          {"p95_mm", rounded(d.p95_mm)},
          {"max_mm", rounded(d.max_mm)}};
}

nlohmann::ordered_json as_json(const Measured& m) {
  const eval::GeometryError& e = m.error;
  nlohmann::ordered_json out{{"reference", m.reference_key},
                             {"to_reference", as_json(e.to_reference)},
                             {"from_reference", as_json(e.from_reference)},
                             {"duplicate_ratio", rounded_ratio(e.duplicate_ratio)},
                             {"missing_ratio", rounded_ratio(e.missing_ratio)},
                             {"seen_ratio", rounded_ratio(e.seen_ratio)},
                             {"nonmanifold_edges", e.nonmanifold_edges},
                             {"seam_gap_p95_mm", rounded(e.seam_gap_p95_mm)},
                             {"boundary_m", rounded(e.boundary_m)},
                             {"components", e.components},
                             {"pairs", nlohmann::ordered_json::array()}};
  for (const PairResidual& pair : m.pairs)
    out["pairs"].push_back(
        {{"a", pair.a}, {"b", pair.b}, {"residual_mm", rounded(pair.residual_mm)}});
  return out;
}

std::string as_text(const eval::SurfaceDistance& d) {
  return fmt::format("{:9.2f} {:9.2f} {:9.2f} {:9.2f}\n", d.mean_mm, d.rms_mm, d.p95_mm, d.max_mm);
}

std::string as_text(const Measured& m) {
  const eval::GeometryError& e = m.error;
  std::string out = fmt::format("{}\nagainst {}\n", m.tested, m.reference);
  out += fmt::format("  {:<26} {:>9} {:>9} {:>9} {:>9}\n", "distances in mm", "mean", "RMS", "95 %",
                     "max");
  out += fmt::format("  {:<26} ", "to the reference") + as_text(e.to_reference);
  out += fmt::format("  {:<26} ", "from what is seen of it") + as_text(e.from_reference);
  const auto line = [&](const char* name, const std::string& value, const char* unit) {
    out += fmt::format("  {:<26} {:>9} {}\n", name, value, unit);
  };
  line("duplicate layers", fmt::format("{:.3f}", 100 * e.duplicate_ratio), "% of the surface");
  line("missing", fmt::format("{:.3f}", 100 * e.missing_ratio), "% of what is seen");
  line("seen of the reference", fmt::format("{:.3f}", 100 * e.seen_ratio), "%");
  line("seam gaps, 95 %", fmt::format("{:.2f}", e.seam_gap_p95_mm), "mm");
  line("border", fmt::format("{:.2f}", e.boundary_m), "m");
  line("components", std::to_string(e.components), "");
  line("non-manifold edges", std::to_string(e.nonmanifold_edges), "");
  for (const PairResidual& pair : m.pairs)
    line(fmt::format("{} to {}", pair.a, pair.b).c_str(), fmt::format("{:.2f}", pair.residual_mm),
         "mm RMS between sensors");
  return out;
}

int eval_geometry(const GeometryOptions& options) {
  std::optional<Scene> scene;
  if (!options.compares_files()) {
    if (options.inputs[0].extension() == ".ply")
      return misuse("a .ply file needs another to compare it with: eval geometry A.ply B.ply");
    if (!(scene = load_or_print_problems(options.inputs[0], options.set))) return 1;
  }
  std::optional<Result<Measured>> measured;
  Arena arena(options.threads > 0 || !scene ? options.threads : scene->threads);
  arena.run(
      [&] { measured.emplace(scene ? measure_scene(*scene, options) : compare_files(options)); });
  if (!*measured) return fail(measured->error().message);
  if (!(*measured)->note.empty()) fmt::print(stderr, "note: {}\n", (*measured)->note);
  fmt::print("{}", options.json ? as_json(**measured)
                                          .dump(2, ' ', false,
                                                nlohmann::ordered_json::error_handler_t::replace) +
                                      "\n"
                                : as_text(**measured));
  return 0;
}

}  // namespace

void add_eval_geometry(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<GeometryOptions>();
  CLI::App* command =
      eval.add_subcommand("geometry", "Measure a merged surface, or a mesh file, against another");
  command->add_option("INPUT", options->inputs, "A scene file (YAML), or two PLY files A and B")
      ->required()
      ->expected(1, 2);
  add_set_option(*command, options->set);
  auto* frame = command->add_option("--frame", options->frame, "Which frame, from 0")
                    ->check(CLI::Range(0, 1000000))
                    ->capture_default_str();
  auto* decoded = command->add_flag("--decoded", options->decoded,
                                    "Measure what a client has, not the surface before coding");
  auto* reference =
      command
          ->add_option("--reference", options->reference,
                       "truth: noiseless; monolithic: all sensors in one 1 cm grid; else truth "
                       "where the scene has one")
          ->check(CLI::IsMember({"truth", "monolithic"}));
  command
      ->add_option("--voxel", options->voxel_m,
                   "Metres: what counts as missing, doubled or a gap; else the scene's, or 0.01")
      ->check(between(0.0005, 1));
  command->add_option("--threads", options->threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command->add_flag("--json", options->json, "Print as JSON");
  command->footer(
      "Examples:\n"
      "  meshreduce eval geometry examples/synthetic-room.yaml --frame 3\n"
      "  meshreduce eval geometry merged.ply truth.ply --json");
  command->callback([=, &exit_code] {
    if (options->compares_files() &&
        frame->count() + decoded->count() + reference->count() + options->set.size() > 0)
      exit_code =
          misuse("--frame, --decoded, --reference and --set are for scenes, not for two files");
    else
      exit_code = eval_geometry(*options);
  });
}

}  // namespace mr::apps
