#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <span>

#include "commands.h"
#include "eval_options.h"
#include "mr/core/file.h"
#include "mr/eval/plot.h"
#include "mr/eval/rate_sweep.h"
#include "mr/eval/store.h"
#include "mr/rate/rate_distortion.h"
#include "output.h"

namespace mr::apps {
namespace {

struct RdOptions : EvalOptions {
  std::vector<std::filesystem::path> scenes;
  std::filesystem::path out = "examples/eval/rate", csv, plot;
  std::size_t views = 16;
};

std::string_view text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// A scene's stored sweeps, which are measured where they are missing or of another scene file.
class StoredSweeps {
 public:
  StoredSweeps(std::filesystem::path scene, const RdOptions& options)
      : options_(options),
        scene_file_(std::move(scene)),
        file_(options.out / scene_file_.filename().replace_extension(".json")) {}

  Result<rate::SweepFile> measure() {
    auto scene = load_for_eval(scene_file_, options_.set);
    if (!scene) return Error{Error::Cause::invalid, scene_file_.string() + " cannot be measured"};
    scene->coding.frame_divider = 1;
    if (const Status read = load(); !read) return read.error();
    std::optional<Status> done;
    in_arena(options_, *scene, [&] { done.emplace(measure(*scene)); });
    if (!*done) return done->error();
    return std::move(kept_);
  }

 private:
  Status load() {
    const auto text = read_file(scene_file_);
    if (!text) return text.error();
    eval::Fingerprint print;
    print.add(std::span(*text)).add(options_.moments).add(static_cast<double>(options_.views));
    for (const std::string& set : options_.set) print.add(set);
    kept_.scene_hash = print.hex();
    const auto stored = read_file(file_);
    if (!stored) return {};  // none yet
    auto sweeps = rate::sweeps_from_json(text_of(*stored));
    if (!sweeps && sweeps.error().cause != Error::Cause::unsupported)
      return Error{sweeps.error().cause, file_.string() + ": " + sweeps.error().message};
    if (sweeps && sweeps->scene_hash == kept_.scene_hash) kept_.sweeps = std::move(sweeps->sweeps);
    return {};
  }

  /// In the steady state where the scene has one, and with everything sent anew.
  Status measure(const Scene& scene) {
    std::vector<Scene> ways{scene};
    if (scene.still.layers) ways.emplace_back(scene).still.layers = false;
    cli::ProgressBar bar;
    for (const Scene& way : ways) {
      eval::QualityConfig config = quality_config(options_, bar);
      const auto trial = eval::Trial::prepare(way, config);
      if (!trial) return trial.error();
      for (const std::size_t moment : trial->all_moments()) {
        config.progress = [&](const std::string& step, std::size_t done, std::size_t of) {
          bar.show(fmt::format("{} {} {}", scene.id, moment + 1, step), done, of);
        };
        if (const Status done = measure(*trial, moment, config); !done) return done;
      }
    }
    return {};
  }

  Status measure(const eval::Trial& trial, std::size_t moment, const eval::QualityConfig& config) {
    const int capture = trial.moments().shown(moment);
    const bool layers = eval::is_stateful(trial.scene());
    for (const rate::Sweep& known : kept_.sweeps)
      if (known.moment == capture && known.layers == layers) return {};
    auto sweep = eval::sweep_moment(trial, moment, options_.views, config);
    if (!sweep) return sweep.error();
    kept_.sweeps.push_back(*std::move(sweep));
    return write_file(file_, rate::to_json(kept_));
  }

  const RdOptions& options_;
  std::filesystem::path scene_file_, file_;
  rate::SweepFile kept_;
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
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) return fail("cannot create " + options.out.string() + ": " + error.message());
  std::vector<rate::Sweep> all;
  for (const std::filesystem::path& scene : options.scenes) {
    auto sweeps = StoredSweeps(scene, options).measure();
    if (!sweeps) return fail(sweeps.error().message);
    std::ranges::move(sweeps->sweeps, std::back_inserter(all));
  }
  if (const Status ok = write_all({{options.csv, to_csv(all)}, {options.plot, draw(all)}}); !ok)
    return fail(ok.error().message);
  for (const rate::Sweep& sweep : all) print_hull(sweep);
  return 0;
}

}  // namespace

void add_eval_rd(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<RdOptions>();
  options->moments = 2;
  CLI::App* command = eval.add_subcommand(
      "rd", "Rate against distortion: explore texture scale x QP x decimation x mesh bits");
  command->add_option("SCENES", options->scenes, "Scene files (YAML)")->required();
  add_eval_options(*command, *options);
  command->remove_option(command->get_option("--json"));
  command->add_option("--out", options->out, "Folder of the results, one NAME.json for each scene")
      ->capture_default_str();
  command->add_option("--views", options->views, "At most so many viewpoints")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--csv", options->csv, "Write every setting as a line");
  command->add_option("--plot", options->plot,
                      "Draw the first scene's first moment with its Pareto hull (SVG)");
  command->footer(
      "Moments that are stored already are not measured again, unless the scene file changed.\n"
      "Example:\n  meshreduce eval rd examples/eval/office-still.yaml --csv rd.csv --plot rd.svg");
  command->callback([options, &exit_code] { exit_code = run_rd(*options); });
}

}  // namespace mr::apps
