#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "commands.h"
#include "eval_options.h"
#include "mr/core/file.h"
#include "mr/eval/plot.h"
#include "mr/eval/sweep.h"
#include "output.h"

namespace mr::apps {
namespace {

struct RdOptions : EvalOptions {
  std::filesystem::path scene, csv, plot;
  std::vector<double> scales{1, 0.75, 0.5, 0.25};
  std::vector<int> qps{20, 26, 32, 38, 44};
  std::vector<double> ratios{0.5, 0.2, 0.1, 0.05, 0.02};
  std::vector<int> bits{9, 10, 11};
  int views = 30;
};

struct Swept {
  eval::ReferenceKind reference;
  std::vector<eval::SweepPoint> points;
};

eval::SweepPlan sweep_plan(const RdOptions& options, const Scene& scene) {
  eval::SweepPlan plan;
  for (const double ratio : options.ratios)
    for (const int bits : options.bits)
      plan.geometries.push_back({scene.voxel_m, ratio, -bits, scene.coding.depth_qp});
  for (const double scale : options.scales)
    for (const int qp : options.qps) plan.textures.push_back({scale, qp});
  return plan;
}

std::string draw(const Swept& swept, const Scene& scene) {
  const auto& points = swept.points;
  eval::Plot plot;
  plot.title = fmt::format("{}: {} settings, against {}", scene.id, points.size(),
                           to_string(swept.reference));
  plot.x_label = "Mbit/s at " + fmt::format("{:g}", scene.fps) + " fps";
  plot.y_label = "Multi-View SSIM (masked)";
  eval::Series all{"settings", {}, false, true}, hull{"Pareto hull", {}, true, true};
  for (const auto& p : points) all.points.emplace_back(p.mbps(), p.score.masked.mean);
  for (const std::size_t i : eval::pareto_hull(points))
    hull.points.emplace_back(points[i].mbps(), points[i].score.masked.mean);
  const auto [least, most] = std::minmax_element(all.points.begin(), all.points.end());
  plot.log_x = most->first > 4 * least->first;
  plot.series = {std::move(all), std::move(hull)};
  return eval::draw_svg(plot);
}

Result<Swept> sweep_scene(const Scene& scene, const RdOptions& options) {
  cli::ProgressBar bar;
  const eval::QualityConfig config = quality_config(options, bar);
  const auto trial = eval::Trial::prepare(scene, config);
  if (!trial) return trial.error();
  const eval::SweepPlan plan = sweep_plan(options, scene);
  auto system = eval::make_system(
      scene, {trial->moments(), config.rig_cache, config.eval_cache, plan.geometries});
  if (!system) return system.error();
  eval::SweepReference references;
  const auto views = std::min<std::size_t>(options.views, trial->plan().views.size());
  references.views = trial->plan().views;
  references.views.resize(views);
  references.moments = trial->all_moments();
  auto metric = trial->metric(references.moments, views, 1, config);
  if (!metric) return metric.error();
  references.by_divider.push_back(*std::move(metric));
  auto points = eval::sweep(**system, plan, references, scene.fps,
                            (*system)->scores(references.views, trial->reference()),
                            [&](std::size_t done, std::size_t of) { bar.show("sweep", done, of); });
  if (!points) return points.error();
  return Swept{trial->reference(), *std::move(points)};
}

/// What is worth choosing among the settings.
void print_hull(const Swept& swept) {
  const auto hull = eval::pareto_hull(swept.points);
  fmt::print("{} settings, {} on the hull, against {}:\n", swept.points.size(), hull.size(),
             to_string(swept.reference));
  for (const std::size_t i : hull) {
    const eval::SweepPoint& p = swept.points[i];
    fmt::print(
        "{:8.2f} Mbit/s  SSIM {:.4f}  ratio {:g}, step_exp {}, texture_scale {:g}, "
        "texture_qp {}\n",
        p.mbps(), p.score.masked.mean, p.geometry.ratio, p.geometry.step_exp, p.texture.scale,
        p.texture.qp);
  }
}

int run_rd(const RdOptions& options) {
  if (const Status ok = check({{}, options.csv, {}}); !ok) return fail(ok.error().message);
  if (const Status ok = check({{}, options.plot, {}}); !ok) return fail(ok.error().message);
  auto scene = load_for_eval(options.scene, options.set);
  if (!scene) return 1;
  scene->coding.frame_divider = 1;
  std::optional<Result<Swept>> swept;
  in_arena(options, *scene, [&] { swept.emplace(sweep_scene(*scene, options)); });
  if (!*swept) return fail(swept->error().message);
  const std::string csv = eval::to_csv((*swept)->points, (*swept)->reference);
  if (const Status ok = write_all({{options.csv, csv}, {options.plot, draw(**swept, *scene)}}); !ok)
    return fail(ok.error().message);
  if (options.csv.empty())
    fmt::print("{}", csv);
  else
    print_hull(**swept);
  return 0;
}

}  // namespace

void add_eval_rd(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<RdOptions>();
  CLI::App* command = eval.add_subcommand(
      "rd", "Rate against distortion: sweep texture scale x QP x decimation x mesh bits");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  add_eval_options(*command, *options);
  command->remove_option(command->get_option("--json"));
  const auto list = [&](const char* name, auto& values, const char* what, auto range) {
    command->add_option(name, values, what)->delimiter(',')->check(range)->capture_default_str();
  };
  list("--scales", options->scales, "Texture scales", between(0.01, 1));
  list("--qps", options->qps, "H.264 quantisers", CLI::Range(0, 51));
  list("--ratios", options->ratios, "Shares of the triangles kept", between(0.001, 1));
  list("--bits", options->bits, "Mesh bits: positions in steps of 2^-bits m", CLI::Range(9, 11));
  command->add_option("--views", options->views, "At most so many viewpoints")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--csv", options->csv, "Write every setting as a line; else printed");
  command->add_option("--plot", options->plot, "Draw them with their Pareto hull (SVG)");
  command->footer(
      "What was coded and compared is kept: an interrupted sweep goes on where it was.\n"
      "Example:\n  meshreduce eval rd examples/eval/office-still.yaml --csv rd.csv --plot rd.svg");
  command->callback([options, &exit_code] { exit_code = run_rd(*options); });
}

}  // namespace mr::apps
