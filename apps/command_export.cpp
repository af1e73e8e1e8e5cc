#include <fmt/format.h>

#include <memory>

#include "commands.h"
#include "output.h"

namespace mr::apps {
namespace {

struct ExportOptions {
  std::filesystem::path scene, file;
  std::vector<std::string> set;
  int frame = 0, threads = 0;
};

int export_moment(const ExportOptions& options) {
  const Outputs outputs{options.file, {}, {}};
  if (const Status ok = check(outputs); !ok) return refused(ok.error());
  const auto scene = load_or_print_problems(options.scene, options.set);
  if (!scene) return 1;
  const auto outcome = run_scene(*scene, options.frame + 1, options.threads);
  if (!outcome) return fail(outcome.error().message);
  if (outcome->report.last_frame != options.frame)
    return fail(
        fmt::format("frame {} of scene '{}' did not come through; the newest that did is {}",
                    options.frame, scene->id, outcome->report.last_frame));
  if (const Status written = write_outputs(*outcome, *scene, outputs); !written)
    return fail(written.error().message);
  fmt::print("{}: {} triangles\n", options.file.string(), outcome->report.triangles);
  return 0;
}

}  // namespace

void add_export(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* command =
      app.add_subcommand("export", "Write one merged moment of a scene for other tools");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  add_set_option(*command, options->set);
  command->add_option("OUT", options->file, "File to write: .glb, .ply or .obj")->required();
  command->add_option("--frame", options->frame, "Which frame, from 0")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  command->add_option("--threads", options->threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command->footer("Example:\n  meshreduce export examples/red-kitchen.yaml kitchen.ply --frame 0");
  command->callback([options, &exit_code] { exit_code = export_moment(*options); });
}

}  // namespace mr::apps
