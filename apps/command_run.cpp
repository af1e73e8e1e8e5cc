#include <fmt/format.h>

#include <memory>

#include "commands.h"
#include "output.h"

namespace mr::apps {
namespace {

struct RunOptions {
  std::filesystem::path scene;
  int frames = 1, threads = 0;
  Outputs outputs;
  bool json = false;
};

int run(const RunOptions& options) {
  if (const Status ok = check(options.outputs); !ok) return fail(ok.error().message);
  const auto scene = load_or_tell(options.scene);
  if (!scene) return 1;
  const auto outcome = run_scene(*scene, options.frames, options.threads);
  if (!outcome) return fail(outcome.error().message);
  if (const Status written = write_outputs(*outcome, *scene, options.outputs); !written)
    return fail(written.error().message);
  fmt::print("{}", options.json ? to_json(outcome->report) : to_text(outcome->report));
  return 0;
}

}  // namespace

void add_run(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<RunOptions>();
  CLI::App* command = app.add_subcommand("run", "Run a whole scene in one process, in lockstep");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  command->add_option("--frames", options->frames, "Frames to run")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command->add_option("--export", options->outputs.model,
                      "Write the last merged frame (.glb, .ply or .obj)");
  command->add_option("--report", options->outputs.report, "Write figures as JSON");
  command->add_option("--snapshot", options->outputs.snapshots,
                      "Write PNGs from several viewpoints into this folder");
  command->add_option("--threads", options->threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->footer(
      "Example:\n  meshreduce run examples/red-kitchen.yaml --frames 3 --export kitchen.glb "
      "--snapshot pictures");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace mr::apps
