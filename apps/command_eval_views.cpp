#include <fmt/format.h>

#include <memory>

#include "commands.h"
#include "eval_options.h"
#include "mr/core/file.h"
#include "mr/eval/quality.h"
#include "mr/synth/room.h"
#include "output.h"

namespace mr::apps {
namespace {

struct ViewsOptions : EvalOptions {
  std::filesystem::path scene, plan;
};

int plan_views(const ViewsOptions& options) {
  if (const Status ok = check({{}, options.plan, {}}); !ok) return fail(ok.error().message);
  const auto scene = load_for_eval(options.scene, options.set);
  if (!scene) return 1;
  int code = 0;
  in_arena(options, *scene, [&] {
    const auto plan = eval::plan_scene(*scene, synth::default_rig_cache());
    if (!plan) return void(code = fail(plan.error().message));
    std::vector<Pose> sensors;
    for (const SensorConfig& sensor : scene->sensors) sensors.push_back(sensor.T_world_depth[0]);
    if (!options.plan.empty())
      if (const Status ok = write_file(options.plan, draw_plan_svg(*plan, sensors)); !ok)
        return void(code = fail(ok.error().message));
    const auto file = eval::viewpoints_file(*scene);
    if (const Status ok = write_viewpoints(file, *plan, eval::viewpoints_key(*scene)); !ok)
      return void(code = fail(ok.error().message));
    fmt::print("{}: {} viewpoints {}\n", file.string(), plan->views.size(),
               plan->kind == eval::ViewPlan::Kind::arcs ? "on arcs between the sensors"
                                                        : "where somebody could stand");
  });
  return code;
}

}  // namespace

void add_eval_views(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<ViewsOptions>();
  CLI::App* command = eval.add_subcommand(
      "views", "Choose the viewpoints of a scene and store them beside it (NAME.views.json)");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  add_set_option(*command, options->set);
  command->add_option("--plan", options->plan, "Draw the floor plan with the views (SVG)");
  command->add_option("--threads", options->threads, "Threads; 0: as the scene says")
      ->check(CLI::Range(0, 1024));
  command->footer(
      "Example:\n  meshreduce eval views examples/eval/office-still.yaml --plan plan.svg");
  command->callback([options, &exit_code] { exit_code = plan_views(*options); });
}

}  // namespace mr::apps
