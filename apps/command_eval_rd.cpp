#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "commands.h"
#include "eval_options.h"
#include "mr/eval/plot.h"
#include "mr/rate/rate_distortion.h"
#include "output.h"
#include "rate_sweeps.h"

namespace mr::apps {
namespace {

struct RdOptions : SweepOptions {
  std::vector<std::filesystem::path> scenes;
  std::filesystem::path csv, plot;
};

std::string title(const rate::Sweep& sweep) {
  return fmt::format("{}, capture {}, {}", sweep.scene, sweep.moment,
                     sweep.layers ? "with layers" : "everything anew");
}

std::string draw(const std::vector<rate::Sweep>& sweeps) {
  eval::Plot plot;
  plot.title =
      title(sweeps.front()) + fmt::format(": {} settings", sweeps.front().qualities.size());
  plot.x_label = "Mbit/s at " + fmt::format("{:g}", sweeps.front().fps) + " fps";
  plot.y_label = "Multi-View SSIM (masked)";
  plot.log_x = true;
  eval::Series all{"settings", {}, false, true}, hull{"Pareto hull", {}, true, true};
  const std::vector<rate::RatePoint> points = rate::measured_points(sweeps.front());
  for (const rate::RatePoint& p : points) all.points.emplace_back(p.mbps, p.ssim);
  for (const rate::RatePoint& p : rate::convex_hull(points))
    hull.points.emplace_back(p.mbps, p.ssim);
  plot.series = {std::move(all), std::move(hull)};
  return eval::draw_svg(plot);
}

std::string to_csv(const std::vector<rate::Sweep>& sweeps) {
  std::string out =
      "scene,layers,capture,error_voxels,bits,texture_scale,texture_qp,mbps,ssim_masked,on_hull\n";
  for (const rate::Sweep& sweep : sweeps) {
    const auto points = rate::measured_points(sweep);
    const auto hull = rate::convex_hull(points);
    for (const rate::RatePoint& p : points)
      out += fmt::format(
          "{},{},{},{:g},{},{:g},{},{:.4f},{:.5f},{}\n", sweep.scene, sweep.layers ? 1 : 0,
          sweep.moment, p.setting.error_voxels, p.setting.bits, p.setting.scale, p.setting.qp,
          p.mbps, p.ssim,
          std::ranges::find(hull, p.setting, &rate::RatePoint::setting) == hull.end() ? 0 : 1);
  }
  return out;
}

/// What is worth choosing among the settings.
void print_hull(const rate::Sweep& sweep) {
  fmt::print("{}: {} settings\n", title(sweep), sweep.qualities.size());
  for (const rate::RatePoint& p : rate::convex_hull(rate::measured_points(sweep)))
    fmt::print(
        "{:8.2f} Mbit/s  SSIM {:.4f}  error {:g} voxels, {} bits, texture_scale {:g}, texture_qp "
        "{}\n",
        p.mbps, p.ssim, p.setting.error_voxels, p.setting.bits, p.setting.scale, p.setting.qp);
}

int run_rd(const RdOptions& options) {
  for (const auto& file : {options.csv, options.plot})
    if (const Status ok = check({{}, file, {}}); !ok) return fail(ok.error().message);
  const auto measured = measure_sweeps(options.scenes, options);
  if (!measured) return fail(measured.error().message);
  const std::vector<rate::Sweep>& all = *measured;
  if (const Status ok = write_all({{options.csv, to_csv(all)}, {options.plot, draw(all)}}); !ok)
    return fail(ok.error().message);
  for (const rate::Sweep& sweep : all) print_hull(sweep);
  return 0;
}

}  // namespace

void add_eval_rd(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<RdOptions>();
  CLI::App* command = eval.add_subcommand(
      "rd", "Rate against distortion: explore texture scale x QP x decimation x mesh bits");
  command->add_option("SCENES", options->scenes, "Scene files (YAML)")->required();
  add_sweep_options(*command, *options);
  command
      ->add_option("--out", options->folder, "Folder of the results, one NAME.json for each scene")
      ->capture_default_str();
  command->add_flag("--again", options->again, "Measure again what is stored");
  command->add_option("--csv", options->csv, "Write every setting as a line");
  command->add_option("--plot", options->plot,
                      "Draw the first scene's first moment with its Pareto hull (SVG)");
  command->footer(
      "Moments that are stored already are not measured again, unless the scene file changed.\n"
      "Example:\n  meshreduce eval rd examples/eval/office-still.yaml --csv rd.csv --plot rd.svg");
  command->callback([options, &exit_code] { exit_code = run_rd(*options); });
}

}  // namespace mr::apps
