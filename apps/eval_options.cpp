#include "eval_options.h"

#include "mr/core/parallel.h"
#include "mr/eval/store.h"
#include "mr/node/sources.h"
#include "mr/synth/room.h"
#include "output.h"

namespace mr::apps {

void add_eval_options(CLI::App& command, EvalOptions& options) {
  command
      .add_option("--reference", options.reference,
                  "Compare with `truth` (synthetic scenes' default) or `monolithic`: all sensors "
                  "in one 1 cm grid, textured from uncompressed pictures")
      ->check(CLI::IsMember({"truth", "monolithic"}));
  command.add_option("--moments", options.moments, "Compare pictures at so many moments")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command
      .add_option("--burst", options.burst,
                  "Captures per moment: a key frame and those that follow; the last is compared")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  command.add_option("--threads", options.threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command.add_flag("--json", options.json, "Print the figures as JSON");
}

eval::QualityConfig quality_config(const EvalOptions& options, ProgressBar& bar) {
  eval::QualityConfig config;
  if (options.reference == "truth") config.reference = eval::ReferenceKind::truth;
  if (options.reference == "monolithic") config.reference = eval::ReferenceKind::monolithic;
  config.moments = options.moments, config.burst = options.burst;
  config.rig_cache = synth::default_rig_cache(), config.eval_cache = eval::default_eval_cache();
  config.progress = [&bar](const std::string& step, std::size_t done, std::size_t of) {
    bar.show(step, done, of);
  };
  config.notice = [&bar](const std::string& message) { bar.say("note: " + message); };
  return config;
}

void in_arena(const EvalOptions& options, const Scene& scene, const std::function<void()>& work) {
  Arena arena(options.threads > 0 ? options.threads : scene.threads);
  arena.run(work);
}

std::optional<Scene> load_for_eval(const std::filesystem::path& file) {
  const auto scene = load_or_tell(file);
  if (!scene) return std::nullopt;
  auto prepared = node::prepare_scene(*scene);
  if (prepared) return *std::move(prepared);
  fail(prepared.error().message);
  return std::nullopt;
}

}  // namespace mr::apps
