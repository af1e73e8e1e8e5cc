#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "commands.h"
#include "eval_options.h"
#include "mr/baseline/monolithic.h"
#include "mr/eval/client_run.h"
#include "mr/eval/clipped.h"
#include "mr/eval/depth_fit.h"
#include "mr/eval/geometry_error.h"
#include "mr/eval/label_change.h"
#include "mr/eval/outline.h"
#include "mr/eval/quality.h"
#include "mr/eval/reference_surface.h"
#include "mr/eval/sensor_coverage.h"
#include "mr/synth/room.h"
#include "output.h"

namespace mr::apps {
namespace {

struct SceneOptions : EvalOptions {
  std::filesystem::path scene, pictures;
  std::string pipeline;
  int captures = 30;
};

/// What a client shows after some captures of a scene, measured at the last of them.
struct SceneMeasures {
  std::string scene, pipeline, reference;
  int captures = 0;
  eval::DepthFit depth;
  eval::GeometryError geometry;
  std::optional<double> label_change, clipped_ratio;
  std::optional<eval::OutlineError> outline;
  std::vector<node::InputResidual> pairs;
};

constexpr int kLabelPairs = 10;  // the last of a run, whose labels are compared

/// From the scene's viewpoints, which only scenes with known people need.
Result<std::optional<eval::OutlineError>> outline_of(const Scene& scene, const DecodedScene& shown,
                                                     int capture,
                                                     const std::filesystem::path& pictures,
                                                     const runtime::RunListener& listener) {
  const RigConfig* rig = eval::known_rig(scene);
  if (!rig || rig->people == 0) return std::optional<eval::OutlineError>{};
  const auto plan = eval::scene_viewpoints(scene, synth::default_rig_cache(), listener.warned);
  if (!plan) return plan.error();
  return eval::outline_error(scene, shown, capture, plan->views, pictures);
}

Result<SceneMeasures> measured(const Scene& scene, int captures,
                               const std::filesystem::path& pictures,
                               const runtime::RunListener& listener) {
  if (scene.pipeline == "points")
    return Error{Error::Cause::unsupported,
                 "scene '" + scene.id + "' shows points, which have no surface to measure"};
  const bool exact = eval::has_true_surface(scene);
  const auto capture =
      eval::read_capture(scene, captures - 1, synth::default_rig_cache(), listener.dropped);
  if (!capture) return capture.error();
  const auto reference = exact ? eval::true_surface(scene, captures - 1)
                               : Result<Mesh>(baseline::fuse_all(scene, *capture, 0.01));
  if (!reference) return reference.error();
  const auto run =
      eval::run_client(scene, captures, 1 + kLabelPairs, listener, synth::default_rig_cache());
  if (!run) return run.error();
  const Mesh shown = eval::shown_surface(run->shown());
  const auto geometry = eval::geometry_error(
      shown, *reference, eval::delivered_frustums(scene, *capture, exact),
      {.voxel_m = scene.voxel_m, .captured = eval::captured_half_spaces(scene)});
  if (!geometry) return geometry.error();
  const auto labels = eval::label_change(scene, run->last);
  if (!labels) return labels.error();
  const auto outline = outline_of(scene, run->shown(), captures - 1, pictures, listener);
  if (!outline) return outline.error();
  return SceneMeasures{scene.id,
                       scene.pipeline,
                       exact ? "truth" : "monolithic",
                       captures,
                       eval::depth_fit(shown, scene, *capture, scene.voxel_m),
                       *geometry,
                       *labels,
                       eval::clipped_ratio(run->shown(), *capture),
                       *outline,
                       run->pairs};
}

/// To the millionth.
double to_millionth(double ratio) { return std::round(ratio * 1e6) / 1e6; }

nlohmann::ordered_json or_null(const std::optional<double>& figure) {
  return figure ? nlohmann::ordered_json(to_millionth(*figure)) : nullptr;
}

std::string as_json(const SceneMeasures& m) {
  nlohmann::ordered_json out{
      {"scene", m.scene},
      {"pipeline", m.pipeline},
      {"captures", m.captures},
      {"reference", m.reference},
      {"hole_ratio", to_millionth(m.depth.hole_ratio)},
      {"depth_agreement", to_millionth(m.depth.agreement)},
      {"beyond_1_voxel", to_millionth(m.depth.beyond_1_voxel)},
      {"beyond_3_voxels", to_millionth(m.depth.beyond_3_voxels)},
      {"duplicate_ratio", to_millionth(m.geometry.duplicate_ratio)},
      {"missing_ratio", to_millionth(m.geometry.missing_ratio)},
      {"to_reference_rms_mm", to_millionth(m.geometry.to_reference.rms_mm)},
      {"from_reference_rms_mm", to_millionth(m.geometry.from_reference.rms_mm)},
      {"label_change", or_null(m.label_change)},
      {"clipped_ratio", or_null(m.clipped_ratio)},
      {"outline_px", or_null(m.outline ? std::optional(m.outline->all_px) : std::nullopt)},
      {"outline_seen_px", or_null(m.outline ? m.outline->seen_px : std::nullopt)},
      {"pairs", nlohmann::ordered_json::array()}};
  for (const node::InputResidual& pair : m.pairs)
    out["pairs"].push_back({{"a", pair.a},
                            {"b", pair.b},
                            {"residual_mm", to_millionth(pair.residual_mm)},
                            {"corrected_mm", to_millionth(pair.corrected_mm)}});
  return out.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string as_text(const SceneMeasures& m) {
  std::string out = fmt::format("{}, {}, as a client shows it after {} captures\n", m.scene,
                                m.pipeline, m.captures);
  const auto line = [&](const char* name, double ratio, const char* of) {
    out += fmt::format("  {:<18} {:8.3f} % {}\n", name, 100 * ratio, of);
  };
  line("holes", m.depth.hole_ratio, "of the raw depth shows nothing, or 3 voxels behind");
  line("depth agreement", m.depth.agreement, "of the raw depth, within 3 voxels");
  line("beyond 1 voxel", m.depth.beyond_1_voxel, "of the raw depth has nothing as near");
  line("beyond 3 voxels", m.depth.beyond_3_voxels, "of the raw depth has nothing as near");
  line("duplicate layers", m.geometry.duplicate_ratio, "of the surface");
  line("missing", m.geometry.missing_ratio,
       m.reference == "truth" ? "of the truth that sensors see" : "of one 1 cm grid");
  out += fmt::format("  to / from the reference: {:.2f} / {:.2f} mm RMS\n",
                     m.geometry.to_reference.rms_mm, m.geometry.from_reference.rms_mm);
  if (m.label_change) line("label change", *m.label_change, "of the still surface a capture");
  if (m.clipped_ratio)
    line("clipped", *m.clipped_ratio, "of the worst view's pixels, not so in its camera");
  if (m.outline)
    out +=
        fmt::format("  outlines of people: {:.2f} px from the truth's at 720p, {:.2f} where seen\n",
                    m.outline->all_px, m.outline->seen_px.value_or(0));
  for (const node::InputResidual& pair : m.pairs)
    out += fmt::format("  {} to {}: {:.2f} mm RMS, corrected {:.2f}\n", pair.a, pair.b,
                       pair.residual_mm, pair.corrected_mm);
  return out;
}

int measure_scene(const SceneOptions& options) {
  if (const Status ok = check({{}, {}, options.pictures}); !ok) return fail(ok.error().message);
  if (!options.pictures.empty()) {
    std::error_code failed;
    std::filesystem::create_directories(options.pictures, failed);
    if (failed) return fail("cannot make folder " + options.pictures.string());
  }
  auto scene = load_for_eval(options.scene, options.set);
  if (!scene) return 1;
  if (!options.pipeline.empty()) scene->pipeline = options.pipeline;
  int code = 0;
  in_arena(options, *scene, [&] {
    const auto found = measured(*scene, options.captures, options.pictures, printing_listener());
    if (!found) return void(code = fail(found.error().message));
    fmt::print("{}", options.json ? as_json(*found) : as_text(*found));
  });
  return code;
}

}  // namespace

void add_eval_scene(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<SceneOptions>();
  CLI::App* command = eval.add_subcommand("scene",
                                          "Whether surfaces are whole and steady: holes, agreement "
                                          "with the raw depth, doubled and missing layers, change "
                                          "of labels, clipped colour, outlines of people");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  command->add_option("--captures", options->captures, "Captures until the stream is measured")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command
      ->add_option("--pipeline", options->pipeline,
                   "Measure this pipeline rather than the scene's: meshreduce, holoportation, "
                   "holoportation++, rgbd")
      ->check(CLI::IsMember({"meshreduce", "holoportation", "holoportation++", "rgbd"}));
  command->add_option("--pictures", options->pictures,
                      "Write what was drawn of people into this folder, with the truth's outline "
                      "in green and the drawn one in red");
  add_common_options(*command, *options);
  command->footer(
      "Examples:\n"
      "  meshreduce eval scene examples/eval/office-still.yaml\n"
      "  meshreduce eval scene examples/red-kitchen.yaml --pipeline holoportation --json");
  command->callback([options, &exit_code] { exit_code = measure_scene(*options); });
}

}  // namespace mr::apps
