#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "commands.h"
#include "mr/core/parallel.h"
#include "mr/eval/scene_check.h"
#include "mr/eval/scene_clocks.h"
#include "mr/synth/room.h"
#include "output.h"
#include "recording_info.h"

namespace mr::apps {
namespace {

using Json = nlohmann::ordered_json;

struct InfoOptions {
  std::filesystem::path scene;
  std::vector<std::string> set;
  bool json = false;
  std::optional<bool> pictures;  ///< nothing: those of files, not those that must be rendered
  bool clocks = false;
  eval::ClockSpan clock_span;
};

std::string size_of(const Camera& camera) {
  return fmt::format("{}x{}", camera.width, camera.height);
}

/// To the tenth of a millimetre, or of a per mille.
double rounded(double value) { return std::round(value * 1e4) / 1e4; }

Json sensor_as_json(const SensorConfig& s) {
  const Vec3d at = s.T_world_depth.front().translation;
  return {{"id", s.id},
          {"source", s.source.type()},
          {"items", s.source.content().items},
          {"depth", {s.depth_camera.width, s.depth_camera.height}},
          {"color", s.color_camera ? Json{s.color_camera->width, s.color_camera->height} : Json()},
          {"position_m", {at.x, at.y, at.z}},
          {"moving", s.is_moving()}};
}

Json pictures_as_json(const eval::SensorCheck& c) {
  if (!c.problem.empty()) return {{"problem", c.problem}};
  return {{"depth", {c.depth_width, c.depth_height}},
          {"color", c.color_width > 0 ? Json{c.color_width, c.color_height} : Json()},
          {"valid_ratio", rounded(c.valid_ratio)},
          {"outside_ratio", rounded(c.outside_ratio)},
          {"depth_m",
           {{"min", rounded(c.min_m)}, {"median", rounded(c.median_m)}, {"max", rounded(c.max_m)}}},
          {"hints", c.hints}};
}

double median_mm(const eval::SceneCheck& check) {
  std::vector<double> apart;
  for (const eval::PairFit& pair : check.pairs) apart.push_back(pair.residual_mm);
  std::ranges::sort(apart);
  return apart.empty() ? 0 : apart[apart.size() / 2];
}

Json fit_as_json(const eval::SceneCheck& check) {
  Json pairs = Json::array();
  for (const eval::PairFit& p : check.pairs)
    pairs.push_back({{"a", p.a},
                     {"b", p.b},
                     {"residual_mm", rounded(p.residual_mm)},
                     {"noise_mm", rounded(p.noise_mm)},
                     {"shared_m2", rounded(p.shared_m2)},
                     {"expected_m2", rounded(p.expected_m2)},
                     {"fit", to_string(p.fit)}});
  return {{"rating", check.fit() ? Json(to_string(*check.fit())) : Json()},
          {"median_mm", check.fit() ? Json(rounded(median_mm(check))) : Json()},
          {"misfits", check.misfits},
          {"pairs", std::move(pairs)}};
}

/// To the microsecond.
Json optional_ms(const std::optional<double>& value_ms) {
  return value_ms ? Json(std::round(*value_ms * 1000) / 1000) : Json();
}

Json clocks_as_json(const eval::SceneClocks& clocks) {
  Json out{{"reference", clocks.reference.empty() ? Json() : Json(clocks.reference)},
           {"frames", clocks.frames},
           {"seconds", rounded(clocks.seconds)},
           {"clocks", Json::array()},
           {"pairs", Json::array()}};
  if (!clocks.problem.empty()) out["problem"] = clocks.problem;
  for (const eval::SensorClock& c : clocks.clocks) {
    Json one{{"sensor", c.id},
             {"offset_ms", optional_ms(c.offset_ms)},
             {"sigma_ms", c.offset_ms ? optional_ms(c.sigma_ms) : Json()},
             {"overlap_points", c.overlap_points}};
    if (c.true_ms) one["true_ms"] = optional_ms(c.true_ms);
    if (!c.problem.empty()) one["problem"] = c.problem;
    out["clocks"].push_back(std::move(one));
  }
  for (const eval::ClockPairOffset& p : clocks.pairs)
    out["pairs"].push_back({{"a", p.a},
                            {"b", p.b},
                            {"offset_ms", optional_ms(p.offset_ms)},
                            {"sigma_ms", optional_ms(p.sigma_ms)},
                            {"overlap_points", p.points}});
  return out;
}

/// What was looked at; nothing if it was not asked for.
struct Findings {
  std::optional<eval::SceneCheck> check;
  std::optional<eval::SceneClocks> clocks;
};

Json as_json(const Scene& scene, const Findings& findings) {
  const auto& [check, clocks] = findings;
  Json out{{"scene", scene.id},
           {"fps", scene.fps},
           {"voxel_m", scene.voxel_m},
           {"sensors", Json::array()},
           {"mergers", Json::array()}};
  for (std::size_t i = 0; i < scene.sensors.size(); ++i) {
    out["sensors"].push_back(sensor_as_json(scene.sensors[i]));
    if (check) out["sensors"].back()["pictures"] = pictures_as_json(check->sensors[i]);
  }
  for (const MergerConfig& m : scene.mergers)
    out["mergers"].push_back({{"id", m.id}, {"inputs", m.inputs}, {"deadline_ms", m.deadline_ms}});
  if (check) out["fit"] = fit_as_json(*check);
  if (clocks) out["clocks"] = clocks_as_json(*clocks);
  return out;
}

std::string sensor_as_text(const SensorConfig& s) {
  const Vec3d at = s.T_world_depth.front().translation;
  const std::size_t items = s.source.content().items;
  return fmt::format(
      "  sensor {:<12} {:<12} {:>4} items  depth {:<9} color {:<9} at ({:.2f}, {:.2f}, {:.2f}) "
      "m{}\n",
      s.id, s.source.type(), items > 0 ? std::to_string(items) : "?", size_of(s.depth_camera),
      s.color_camera ? size_of(*s.color_camera) : "none", at.x, at.y, at.z,
      s.is_moving() ? ", moving" : "");
}

std::string pictures_as_text(const eval::SensorCheck& c) {
  if (!c.problem.empty()) return {};  // printed on stderr
  std::string out = fmt::format(
      "    first pictures: depth {}x{}, {:.0f} % valid, {:.2f} to {:.2f} m, median {:.2f} m; "
      "color {}\n",
      c.depth_width, c.depth_height, 100 * c.valid_ratio, c.min_m, c.max_m, c.median_m,
      c.color_width > 0 ? fmt::format("{}x{}", c.color_width, c.color_height) : "none");
  for (const std::string& hint : c.hints) out += fmt::format("    ! {}\n", hint);
  return out;
}

std::string fit_as_text(const eval::SceneCheck& check) {
  if (check.sensors.size() < 2) return {};
  if (!check.fit()) return "fit: unknown, for no two sensors see the same surface\n";
  const eval::PairFit& worst = check.pairs.front();
  std::string out = fmt::format(
      "fit: {}; median {:.1f} mm over {} pairs that see the same; worst {} and {}: {:.1f} mm "
      "({:.1f} "
      "mm are noise) on {:.0f} % of what both should see\n",
      to_string(*check.fit()), median_mm(check), check.pairs.size(), worst.a, worst.b,
      worst.residual_mm, worst.noise_mm, 100 * worst.shared_m2 / worst.expected_m2);
  for (const std::string& id : check.misfits)
    out += fmt::format("  ! {} does not fit the others\n", id);
  if (check.fit() == eval::Fit::bad)
    out +=
        "  ! check T_world_depth (camera to world, metres), depth_unit_m and the cameras' fx, "
        "fy, cx, cy\n";
  return out;
}

/// One line per sensor, and what to write into the scene file.
std::string clocks_as_text(const eval::SceneClocks& clocks) {
  if (!clocks.problem.empty())
    return fmt::format("clocks: unknown, for {} in {} frames\n", clocks.problem, clocks.frames);
  std::string out = fmt::format("clocks, against {}, from what moves in {} frames ({:.1f} s):\n",
                                clocks.reference, clocks.frames, clocks.seconds);
  for (const eval::SensorClock& c : clocks.clocks) {
    if (!c.offset_ms)
      out += fmt::format("  ! {:<12} unknown: {}\n", c.id, c.problem);
    else if (c.id != clocks.reference)
      out += fmt::format("  {:<12} {:+.1f} ms (\u00b1 {:.1f}){}: clock_offset_ms: {:.1f}\n", c.id,
                         *c.offset_ms, c.sigma_ms,
                         c.true_ms ? fmt::format(", truly {:+.1f} ms", *c.true_ms) : "",
                         c.clock_offset_ms);
  }
  return out +
         "  (+: it captures later than its frames say; write clock_offset_ms into its entry under "
         "sensors)\n";
}

std::string as_text(const Scene& scene, const Findings& findings) {
  const auto& [check, clocks] = findings;
  std::string out =
      fmt::format("scene {}: {} sensors, {} mergers, {} fps, {} mm voxels\n", scene.id,
                  scene.sensors.size(), scene.mergers.size(), scene.fps, scene.voxel_m * 1000);
  for (std::size_t i = 0; i < scene.sensors.size(); ++i) {
    out += sensor_as_text(scene.sensors[i]);
    if (check) out += pictures_as_text(check->sensors[i]);
  }
  for (const MergerConfig& m : scene.mergers)
    out += fmt::format("  merger {:<12} from {}, waits {} ms\n", m.id, fmt::join(m.inputs, " "),
                       m.deadline_ms);
  return out + (check ? fit_as_text(*check) : "") + (clocks ? clocks_as_text(*clocks) : "");
}

/// Prints each sensor whose picture cannot be read; returns exit code 1 if there is one.
int print_unreadable(const eval::SceneCheck& check) {
  int code = 0;
  for (const eval::SensorCheck& sensor : check.sensors)
    if (!sensor.problem.empty()) code = fail("sensor " + sensor.id + ": " + sensor.problem);
  return code;
}

int info(const InfoOptions& options) {
  if (is_recording(options.scene)) return describe_recording(options.scene, options.json);
  auto scene = load_or_print_problems(options.scene, options.set);
  if (!scene) return 1;
  if (scene->rig) scene->sensors = synth::rig_sensors(*scene->rig);
  Findings findings;
  Arena(scene->threads).run([&] {
    const std::filesystem::path rig_cache = synth::default_rig_cache();
    if (options.pictures.value_or(!scene->rig))
      findings.check = eval::check_scene(*scene, rig_cache);
    if (options.clocks)
      findings.clocks = eval::compare_clocks(*scene, rig_cache, options.clock_span);
  });
  fmt::print(
      "{}",
      options.json
          ? as_json(*scene, findings).dump(2, ' ', false, Json::error_handler_t::replace) + "\n"
          : as_text(*scene, findings));
  return findings.check ? print_unreadable(*findings.check) : 0;
}

}  // namespace

void add_info(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* command = app.add_subcommand(
      "info",
      "Check a scene file and its first pictures, and how sensors fit; describe a recording");
  command
      ->add_option("FILE", options->scene, "Scene file (YAML), recording, or folder of a data set")
      ->required();
  add_set_option(*command, options->set);
  command->add_flag("--json", options->json, "Print as JSON");
  command->add_flag_function(
      "--pictures,!--no-pictures", [options](std::int64_t count) { options->pictures = count > 0; },
      "Open the first picture of each sensor; without either, those of files are opened, and those "
      "of a rig, which must be rendered, are not");
  command->add_flag("--clocks", options->clocks,
                    "Estimate by how much the sensors' clocks disagree, from what moves before "
                    "two of them at once");
  command
      ->add_option("--clock-from", options->clock_span.from_s,
                   "With --clocks: where reading begins, in seconds; from two places of long "
                   "recordings, how clocks drift is seen")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command
      ->add_option("--clock-seconds", options->clock_span.seconds,
                   "With --clocks: how much of the recordings is read")
      ->check(CLI::Range(0.5, 60.0))
      ->capture_default_str();
  command->footer(
      "Examples:\n"
      "  meshreduce info examples/red-kitchen.yaml\n"
      "  meshreduce info people.yaml --clocks        which clock_offset_ms each sensor needs");
  command->callback([options, &exit_code] { exit_code = info(*options); });
}

}  // namespace mr::apps
