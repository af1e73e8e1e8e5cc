#include <fmt/format.h>

#include <memory>

#include "commands.h"
#include "output.h"

namespace mr::apps {
namespace {

struct DemoOptions {
  std::filesystem::path folder = "demo";
  int frames = 3, threads = 0;
};

/// Four Kinect-like sensors in a furnished room of 6 × 5 × 3 m.
Scene demo_scene() {
  Scene scene;
  scene.id = "synthetic-room";
  scene.rig = RigConfig{};
  scene.simplify.ratio = 0.1;
  scene.fusion.truncation_m = 0.06;
  MergerConfig root{.id = "root", .inputs = {}, .deadline_ms = 50};
  for (int i = 0; i < scene.rig->sensors; ++i) root.inputs.push_back("cam-" + std::to_string(i));
  scene.mergers = {root};
  return scene;
}

int demo(const DemoOptions& options) {
  std::error_code failed;
  std::filesystem::create_directories(options.folder, failed);
  if (failed)
    return fail("cannot make folder " + options.folder.string() + ": " + failed.message());
  const Outputs outputs{options.folder / "demo.glb", options.folder / "report.json",
                        options.folder / "pictures"};
  const Scene scene = demo_scene();
  const auto outcome = run_scene(scene, options.frames, options.threads);
  if (!outcome) return fail(outcome.error().message);
  if (const Status written = write_outputs(*outcome, scene, outputs); !written)
    return fail(written.error().message);
  fmt::print("{}\nWritten: {} (open it in any glTF viewer), {}, pictures in {}\n\n",
             to_text(outcome->report), outputs.model.string(), outputs.report.string(),
             outputs.snapshots.string());
  fmt::print(
      "Next:\n"
      "  a real kitchen, eight views   meshreduce run examples/red-kitchen.yaml --frames 3 "
      "--export kitchen.glb\n"
      "  your own pictures             copy examples/own-data.yaml, fill in cameras and poses, "
      "then\n"
      "                                meshreduce info SCENE.yaml && meshreduce run SCENE.yaml "
      "--export out.glb\n");
  return 0;
}

}  // namespace

void add_demo(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<DemoOptions>();
  CLI::App* command = app.add_subcommand("demo", "Run the whole pipeline on a synthetic room");
  command->add_option("--out", options->folder, "Folder for the model, the report and pictures")
      ->capture_default_str();
  command->add_option("--frames", options->frames, "Frames to run")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command->add_option("--threads", options->threads, "Threads; 0: all cores")
      ->check(CLI::Range(0, 1024));
  command->footer("Example:\n  meshreduce demo --out /tmp/demo");
  command->callback([options, &exit_code] { exit_code = demo(*options); });
}

}  // namespace mr::apps
