#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "commands.h"
#include "live.h"
#include "mr/synth/demo_scene.h"
#include "output.h"

namespace mr::apps {
namespace {

struct DemoOptions {
  bool small = false;
  bool no_viewer = false;
  int frames = 0;
  std::vector<std::string> set;
  Outputs outputs;
  bool burn_sequence = false;
  LiveRun live;
};

/// What `--small` makes of it: quick on two cores.
const std::vector<std::string> kSmall{"voxel_m=0.03",         "rig.depth_mode=nfov_binned",
                                      "rig.color=[640, 360]", "fusion.chunk_m=2.56",
                                      "simplify.ratio=0.05",  "atlas.size=[1280, 720]"};

/// Live, viewers choose what they get.
const std::vector<std::string> kLive{"rate.model=ours", "rate.target_mbps=30"};

int demo(const DemoOptions& options) {
  if (const Status ok = check(options.outputs); !ok) return refused(ok.error());
  std::vector<std::string> set;
  if (options.small) set = kSmall;
  if (!options.no_viewer) set.insert(set.end(), kLive.begin(), kLive.end());
  set.insert(set.end(), options.set.begin(), options.set.end());
  auto preset = usable_or_print_problems(parse_scene(synth::kDemoScene, "demo", set));
  if (!preset) return 1;
  Scene& scene = *preset;
  scene.atlas.burn_sequence |= options.burn_sequence;
  if (!options.no_viewer) {
    LiveRun live = options.live;
    live.report = options.outputs.report;
    return run_live(std::move(scene), live);
  }
  const auto outcome = run_scene(scene, options.frames, options.live.threads);
  if (!outcome) return fail(outcome.error().message);
  if (const Status written = write_outputs(*outcome, scene, options.outputs); !written)
    return fail(written.error().message);
  fmt::print("{}", to_text(outcome->report));
  return 0;
}

}  // namespace

void add_demo(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<DemoOptions>();
  options->frames = 30;
  CLI::App* command = app.add_subcommand(
      "demo", "Two people in a synthetic room, seen by four sensors, live in a browser");
  add_set_option(*command, options->set);
  command->add_flag("--small", options->small,
                    "Coarser, with smaller pictures: quick on two cores, learnt in seconds");
  command->add_option("--listen", options->live.listen, "Address of the viewer, host:port");
  command->add_option("--page", options->live.page, "Folder of the built viewer");
  command->add_flag("--open", options->live.open_browser, "Open a browser window");
  command->add_option("--seconds", options->live.seconds, "Stop after so long; 0: when interrupted")
      ->check(CLI::Range(0.0, 1e9));
  command->add_option("--threads", options->live.threads, "Threads; 0: all cores")
      ->check(CLI::Range(0, 1024));
  command->add_option("--report", options->outputs.report, "Write figures as JSON at the end");
  CLI::Option* no_viewer =
      command->add_flag("--no-viewer", options->no_viewer, "Run in lockstep, without a browser");
  command->add_option("--frames", options->frames, "Frames to run without a viewer")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str()
      ->needs(no_viewer);
  command
      ->add_option("--export", options->outputs.model,
                   "Without a viewer: write the last merged frame (.glb, .ply or .obj)")
      ->needs(no_viewer);
  command
      ->add_option("--snapshot", options->outputs.snapshots,
                   "Without a viewer: write PNGs from several viewpoints into this folder")
      ->needs(no_viewer);
  command->add_flag("--burn-sequence", options->burn_sequence,
                    "For tests: paint each packet's number into its picture");
  command->footer(
      "Examples:\n"
      "  meshreduce demo                                          then open http://127.0.0.1:8080\n"
      "  meshreduce demo --small                                  on two cores\n"
      "  meshreduce demo --no-viewer --frames 30 --report demo.json --export demo.glb\n"
      "Next:\n"
      "  meshreduce run examples/red-kitchen.yaml --frames 3 --export kitchen.glb   a real room\n"
      "  examples/own-data.yaml                                   for your own pictures");
  command->callback([options, &exit_code] { exit_code = demo(*options); });
}

}  // namespace mr::apps
