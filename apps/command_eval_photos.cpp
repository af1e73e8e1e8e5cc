#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "commands.h"
#include "eval_options.h"
#include "mr/eval/photos.h"
#include "mr/synth/room.h"
#include "output.h"

namespace mr::apps {
namespace {

struct PhotoOptions : EvalOptions {
  std::filesystem::path scene;
  std::string pipeline;
  std::vector<std::string> beside;
  eval::PhotoConfig config;
};

/// The systems to be measured, the one of the options or the scene first; nothing where one is
/// named twice.
std::optional<std::vector<std::string>> systems_of(const PhotoOptions& options,
                                                   const Scene& scene) {
  std::vector<std::string> out{options.pipeline.empty() ? scene.pipeline : options.pipeline};
  for (const std::string& name : options.beside) {
    if (std::ranges::find(out, name) != out.end()) {
      misuse("--beside: '" + name + "' is measured already");
      return std::nullopt;
    }
    out.push_back(name);
  }
  return out;
}

int compare_photographs(const PhotoOptions& options) {
  if (const Status ok = check({{}, {}, options.config.pictures}); !ok)
    return fail(ok.error().message);
  const auto scene = load_for_eval(options.scene, options.set);
  if (!scene) return 1;
  eval::PhotoConfig config = options.config;
  const auto systems = systems_of(options, *scene);
  if (!systems) return 2;
  config.systems = *systems;
  config.rig_cache = synth::default_rig_cache();
  int code = 0;
  in_arena(options, *scene, [&] {
    const auto report = eval::compare_with_photographs(*scene, config, printing_listener());
    if (!report) return void(code = fail(report.error().message));
    fmt::print("{}", options.json ? eval::to_json(*report) : eval::to_text(*report));
  });
  return code;
}

void add_photo_options(CLI::App& command, PhotoOptions& options) {
  eval::PhotoConfig& config = options.config;
  command.add_option("SCENE", options.scene, "Scene file (YAML)")->required();
  command
      .add_option("--color", config.photographs.color,
                  "Photographs (JPEG, PNG): a pattern with one number, such as frame-%06d.jpg")
      ->required();
  command
      .add_option("--pose", config.photographs.pose,
                  "Their poses, T_world_depth as 4x4 text files: a pattern like --color")
      ->required();
  command
      .add_option("--frames", config.photographs.frames,
                  "These numbers; else all up to 99999 whose picture exists")
      ->delimiter(',')
      ->check(CLI::Range(0, 999'999'999));
  command.add_option("--camera", config.camera,
                     "The sensor whose colour camera took them; else the scene's first");
  command.add_option("--captures", config.captures, "Captures until the stream is compared")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  const auto systems = CLI::IsMember(eval::photo_systems());
  command
      .add_option("--pipeline", options.pipeline,
                  "Measure this rather than the scene's pipeline: meshreduce, holoportation, "
                  "holoportation++, points, rgbd, vertex-colors, single-views, levelled-views")
      ->check(systems);
  command
      .add_option("--beside", options.beside,
                  "Measure these too, all on the pixels that every one covers")
      ->delimiter(',')
      ->check(systems);
  command.add_option("--pictures", config.pictures,
                     "Write each photograph, with the renders to its right, into this folder");
  add_common_options(command, options);
}

}  // namespace

void add_eval_photos(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<PhotoOptions>();
  CLI::App* command = eval.add_subcommand(
      "photos", "A scene's decoded stream beside photographs that no sensor of it delivered");
  add_photo_options(*command, *options);
  command->footer(
      "Examples:\n"
      "  meshreduce eval photos room.yaml --color photo-%04d.jpg --pose photo-%04d.txt --json\n"
      "  meshreduce eval photos examples/eval/red-kitchen.yaml --frames 20,60,110 "
      "--color $MR_DATA/sevenscenes_redkitchen/frame-%06d.color.jpg "
      "--pose $MR_DATA/sevenscenes_redkitchen/frame-%06d.pose.txt --beside vertex-colors");
  command->callback([options, &exit_code] { exit_code = compare_photographs(*options); });
}

}  // namespace mr::apps
