#include "eval_options.h"

#include <fmt/format.h>

#include "mr/core/file.h"
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
      ->check(CLI::Range(2, 10000))
      ->capture_default_str();
  add_common_options(command, options);
}

void add_common_options(CLI::App& command, EvalOptions& options) {
  command.add_option("--threads", options.threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command.add_flag("--json", options.json, "Print the figures as JSON");
  add_set_option(command, options.set);
}

bool is_reference(const std::string& pipeline, eval::ReferenceKind reference) {
  return pipeline == "holoportation" && reference == eval::ReferenceKind::monolithic;
}

CLI::Validator between(double low, double high) {
  const std::string name = fmt::format("FLOAT in [{:g} - {:g}]", low, high);
  return CLI::Validator(
      [=](std::string& text) {
        double value = 0;
        const bool good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
        return good ? std::string()
                    : text + " is no number in [" + fmt::format("{:g} - {:g}]", low, high);
      },
      name);
}

eval::QualityConfig quality_config(const EvalOptions& options, cli::ProgressBar& bar) {
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

Status write_all(const std::vector<std::pair<std::filesystem::path, std::string>>& files) {
  for (std::size_t i = 0; i < files.size(); ++i) {
    const Status written =
        files[i].first.empty() ? Status{} : write_file(files[i].first, files[i].second);
    if (written) continue;
    std::error_code ignored;
    for (std::size_t j = 0; j < i; ++j) std::filesystem::remove(files[j].first, ignored);
    return written;
  }
  return {};
}

std::optional<Scene> load_for_eval(const std::filesystem::path& file,
                                   const std::vector<std::string>& set) {
  const auto scene = load_or_print_problems(file, set);
  if (!scene) return std::nullopt;
  auto prepared = node::prepare_scene(*scene);
  if (prepared) return *std::move(prepared);
  fail(prepared.error().message);
  return std::nullopt;
}

}  // namespace mr::apps
