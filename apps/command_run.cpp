#include <fmt/format.h>

#include <memory>

#include "commands.h"
#include "live.h"
#include "output.h"

namespace mr::apps {
namespace {

struct RunOptions {
  std::filesystem::path scene;
  std::vector<std::string> set;
  int frames = 0;
  Outputs outputs;
  LiveRun live;
  bool json = false;

  /// Whether frames are counted rather than played.
  bool lockstep() const {
    return frames > 0 || json || !outputs.model.empty() || !outputs.snapshots.empty();
  }
};

int run(const RunOptions& options) {
  if (const Status ok = check(options.outputs); !ok) return refused(ok.error());
  const auto scene = load_or_print_problems(options.scene, options.set);
  if (!scene) return 1;
  if (!options.lockstep()) {
    LiveRun live = options.live;
    live.report = options.outputs.report;
    return run_live(*scene, live);
  }
  const auto outcome = run_scene(*scene, std::max(options.frames, 1), options.live.threads);
  if (!outcome) return fail(outcome.error().message);
  if (const Status written = write_outputs(*outcome, *scene, options.outputs); !written)
    return fail(written.error().message);
  fmt::print("{}", options.json ? to_json(outcome->report) : to_text(outcome->report));
  return 0;
}

}  // namespace

void add_run(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<RunOptions>();
  CLI::App* command = app.add_subcommand(
      "run", "Run a whole scene in one process: live in a browser, or frame by frame");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  add_set_option(*command, options->set);
  command
      ->add_option("--frames", options->frames,
                   "Run so many frames in lockstep, without a viewer; else live")
      ->check(CLI::Range(1, 1000000));
  command->add_option("--export", options->outputs.model,
                      "Write the last merged frame (.glb, .ply or .obj); in lockstep, 1 frame "
                      "unless --frames says more");
  command->add_option("--report", options->outputs.report, "Write figures as JSON");
  command->add_option("--snapshot", options->outputs.snapshots,
                      "Write PNGs from several viewpoints into this folder; in lockstep");
  command->add_option("--threads", options->live.threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command->add_flag("--json", options->json, "Print the figures as JSON; in lockstep");
  command->add_option("--listen", options->live.listen, "Live: address of the viewer, host:port");
  command->add_option("--page", options->live.page, "Live: folder of the built viewer");
  command
      ->add_option("--seconds", options->live.seconds,
                   "Live: stop after so long; 0: when interrupted")
      ->check(CLI::Range(0.0, 1e9));
  command->footer(
      "Examples:\n"
      "  meshreduce run examples/synthetic-room.yaml                 live, in a browser\n"
      "  meshreduce run examples/red-kitchen.yaml --frames 3 --export kitchen.glb "
      "--snapshot pictures");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace mr::apps
