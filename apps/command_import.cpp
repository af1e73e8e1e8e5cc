#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "commands.h"
#include "mr/core/file.h"
#include "mr/core/user_text.h"
#include "mr/scene/scene.h"
#include "mr/scene/scene_text.h"
#include "output.h"
#include "recording_info.h"

namespace mr::apps {
namespace {

using Json = nlohmann::ordered_json;

struct ImportOptions {
  std::vector<std::filesystem::path> paths;  ///< recordings; the last may be the scene file
  std::string id;
  bool json = false, force = false;
};

bool is_scene_file(const std::filesystem::path& path) {
  return path.extension() == ".yaml" || path.extension() == ".yml";
}

Result<sensor::ImportedScene> import_one(const std::filesystem::path& path) {
  std::error_code failed;
  if (!std::filesystem::exists(path, failed))
    return Error{Error::Cause::not_found, "no such file or folder: " + in_quotes(path.string())};
  const std::filesystem::path whole = whole_path(path);
  const sensor::RecordingFormat* format = sensor::recognize(whole);
  if (!format) return Error{Error::Cause::unsupported, unknown_format(path, true)};
  if (!format->import)
    return Error{Error::Cause::unsupported,
                 in_quotes(path.string()) + " is of a format that makes no scene by itself (" +
                     std::string(format->name) + "); can be imported: " + known_formats(true)};
  return format->import(whole);
}

Result<sensor::ImportedScene> import_all(const std::vector<std::filesystem::path>& paths,
                                         const std::string& id) {
  std::vector<sensor::ImportedScene> scenes;
  for (const auto& path : paths) {
    auto scene = import_one(path);
    if (!scene) return scene.error();
    scenes.push_back(*std::move(scene));
  }
  sensor::ImportedScene out = one_scene(std::move(scenes));
  if (id.empty()) return out;
  out.name = id;
  if (out.sensors.size() == 1) out.sensors[0].id = id;
  return out;
}

/// What keeps a scene from being loaded, in one line; nothing: it loads.
Status check_scene_text(const std::string& text, const std::filesystem::path& file) {
  const SceneResult loaded = parse_scene(text, file);
  if (loaded.problems.empty()) return {};
  const std::size_t more = loaded.problems.size() - 1;
  return Error{Error::Cause::invalid,
               "the scene would not load: " + loaded.problems[0].message +
                   (more > 0 ? fmt::format(" (and {} more problems)", more) : "")};
}

void print_outcome(const sensor::ImportedScene& scene, const std::filesystem::path& out) {
  for (const sensor::ImportedSensor& sensor : scene.sensors)
    fmt::print("sensor {}: {}\n", sensor.id,
               sensor.T_world_depth.empty() ? "where it stands is not known" : "with poses");
  for (const std::string& note : scene.notes) fmt::print("  ! {}\n", note);
  fmt::print("Next: meshreduce info {0}\n      meshreduce run {0}\n", out.string());
}

void print_json(const sensor::ImportedScene& scene, const std::filesystem::path& out) {
  Json sensors = Json::array();
  for (const sensor::ImportedSensor& sensor : scene.sensors)
    sensors.push_back({{"id", sensor.id},
                       {"has_pose", !sensor.T_world_depth.empty()},
                       {"has_color", sensor.color_camera.has_value()}});
  const Json all{{"scene", scene.name},
                 {"file", out.string()},
                 {"fps", scene.fps},
                 {"sensors", std::move(sensors)},
                 {"notes", scene.notes}};
  fmt::print("{}\n", all.dump(2, ' ', false, Json::error_handler_t::replace));
}

int import_recordings(const ImportOptions& options) {
  std::vector<std::filesystem::path> recordings = options.paths;
  std::filesystem::path out;
  if (recordings.size() > 1 && is_scene_file(recordings.back())) {
    out = recordings.back();
    recordings.pop_back();
  }
  if (options.json && out.empty()) return misuse("--json needs OUT.yaml beside the recordings");
  std::error_code failed;
  if (!out.empty() && !options.force && std::filesystem::exists(out, failed))
    return fail(out.string() + " is there already; choose another name or add --force");
  const auto scene = import_all(recordings, options.id);
  if (!scene) return fail(scene.error().message);
  const auto folder = whole_path(out.has_parent_path() ? out.parent_path() : ".");
  const std::string text = scene_text(*scene, folder);
  const Status loads =
      check_scene_text(text, folder / (out.empty() ? "scene.yaml" : out.filename()));
  if (!loads) return fail(loads.error().message);
  if (out.empty()) {
    fmt::print("{}", text);
    return 0;
  }
  if (const Status written = write_file(out, text); !written) return fail(written.error().message);
  options.json ? print_json(*scene, out) : print_outcome(*scene, out);
  return 0;
}

}  // namespace

void add_import(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<ImportOptions>();
  CLI::App* command =
      app.add_subcommand("import", "Write a scene file for recordings and data sets");
  command
      ->add_option("PATH", options->paths,
                   "Recordings, files or folders; several become one scene. The last may be "
                   "OUT.yaml, the file to write; without it the scene is printed")
      ->required();
  command
      ->add_option("--id", options->id, "Name of the scene, and of the sensor where there is one")
      ->check([](const std::string& text) {
        const bool good = !text.empty() && text.size() <= 64 &&
                          text.find_first_not_of(
                              "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVW"
                              "XYZ0123456789-_") == std::string::npos;
        return good ? std::string() : "must be 1 to 64 letters, digits, - and _";
      });
  command->add_flag("--json", options->json, "Print what was written as JSON");
  command->add_flag("--force", options->force, "Write over an existing file");
  command->footer("Example:\n  meshreduce import rgbd_dataset_freiburg1_desk desk.yaml\nFormats: " +
                  known_formats(true));
  command->callback([options, &exit_code] { exit_code = import_recordings(*options); });
}

}  // namespace mr::apps
