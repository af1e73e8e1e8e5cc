#include <fmt/format.h>

#include <memory>

#include "commands.h"
#include "eval_options.h"
#include "mr/eval/still_error.h"
#include "output.h"

namespace mr::apps {
namespace {

struct StillOptions : EvalOptions {
  std::filesystem::path scene;
  std::optional<bool> layers;
  int captures = 100, pairs = 10;
};

int measure_still(const StillOptions& options) {
  auto scene = load_for_eval(options.scene, options.set);
  if (!scene) return 1;
  if (options.layers) scene->still.layers = *options.layers;
  if (scene->pipeline != "meshreduce")
    return fail("scene '" + scene->id +
                "': only the pipeline meshreduce has a still surface, not " + scene->pipeline);
  int code = 0;
  in_arena(options, *scene, [&] {
    cli::ProgressBar bar;
    eval::QualityConfig quality = quality_config(options, bar);
    quality.reference = eval::ReferenceKind::truth;
    const auto trial = eval::Trial::prepare(*scene, quality);
    if (!trial) return void(code = fail(trial.error().message));
    eval::StillErrorConfig config;
    config.captures = options.captures, config.pairs = options.pairs;
    config.rig_cache = quality.rig_cache;
    config.progress = quality.progress, config.notice = quality.notice;
    const auto error = eval::still_error(trial->scene(), trial->plan().views, config);
    if (!error) return void(code = fail(error.error().message));
    bar.hide();
    fmt::print("{}", options.json ? eval::to_json(*error) : eval::to_text(*error));
  });
  return code;
}

}  // namespace

void add_eval_still(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<StillOptions>();
  CLI::App* command = eval.add_subcommand(
      "still",
      "What stays of a synthetic scene: whether it flickers, how far it is from the truth, whether "
      "what is hidden for a while stays");
  command->add_option("SCENE", options->scene, "Scene file (YAML) of a synthetic rig")->required();
  command->add_option("--layers", options->layers,
                      "true: keep the still surface; false: make all anew; else as the scene says");
  command->add_option("--captures", options->captures, "Captures before the comparison")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--pairs", options->pairs, "Pairs of consecutive captures to compare")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  add_common_options(*command, *options);
  command->footer(
      "Examples:\n"
      "  meshreduce eval still bench/scenes/two_people.yaml --layers true\n"
      "  meshreduce eval still bench/scenes/two_people.yaml --set still.layers=false --json");
  command->callback([options, &exit_code] { exit_code = measure_still(*options); });
}

}  // namespace mr::apps
