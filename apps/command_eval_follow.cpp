#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "eval_options.h"
#include "mr/core/file.h"
#include "mr/eval/plot.h"
#include "mr/eval/rate_run.h"
#include "mr/kit/image_io.h"
#include "output.h"

namespace mr::apps {
namespace {

using eval::RateSecond;

struct FollowOptions : EvalOptions {
  std::filesystem::path scene, plot, pictures;
  std::string trace = "steps";
  std::size_t views = 0;
  double low_mbps = 2, high_mbps = 20;
  int seconds = 30;
  std::uint64_t seed = 1;
};

nlohmann::ordered_json to_json(const std::vector<RateSecond>& seconds) {
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  for (const RateSecond& s : seconds)
    out.push_back({{"target_mbps", s.target_mbps},
                   {"mbps", s.mbps},
                   {"refinement_mbps", s.refinement_mbps},
                   {"worst_mbps", s.worst_mbps},
                   {"left_out", s.left_out},
                   {"key_frames", s.key_frames},
                   {"texture_qp", s.qp},
                   {"error_voxels", s.error_voxels},
                   {"texture_scale", s.scale},
                   {"still_chunks", s.still_chunks},
                   {"ssim", s.ssim ? nlohmann::ordered_json(*s.ssim) : nullptr}});
  return out;
}

std::string to_text(const std::vector<RateSecond>& seconds) {
  std::string out =
      "second  target    sent  still, plates  worst second  left out  keys  QP  error  scale  "
      "still chunks    SSIM\n";
  for (std::size_t i = 0; i < seconds.size(); ++i) {
    const RateSecond& s = seconds[i];
    out += fmt::format(
        "{:6} {:7.2f} {:7.2f} {:14.2f} {:13.2f} {:9} {:5} {:3} {:6.2f} {:6.2f} {:13} {:>7}\n", i,
        s.target_mbps, s.mbps, s.refinement_mbps, s.worst_mbps, s.left_out, s.key_frames, s.qp,
        s.error_voxels, s.scale, s.still_chunks, s.ssim ? fmt::format("{:.4f}", *s.ssim) : "");
  }
  return out;
}

std::string draw(const std::vector<RateSecond>& seconds, const std::string& title) {
  eval::Plot plot;
  plot.title = title, plot.x_label = "seconds", plot.y_label = "Mbit/s";
  eval::Series target{"target", {}, true, false}, sent{"sent", {}, true, true},
      still{"still surface and plates", {}, true, false};
  for (std::size_t i = 0; i < seconds.size(); ++i) {
    target.points.emplace_back(i, seconds[i].target_mbps);
    sent.points.emplace_back(i, seconds[i].mbps);
    still.points.emplace_back(i, seconds[i].refinement_mbps);
  }
  plot.series = {target, sent, still};
  return eval::draw_svg(plot);
}

/// second-00-view-00.png, …
Status write_second(const std::filesystem::path& folder, int second,
                    const std::vector<ImageRgb>& pictures) {
  for (std::size_t v = 0; v < pictures.size(); ++v)
    if (Status ok = kit::write_png(folder / fmt::format("second-{:02}-view-{:02}.png", second, v),
                                   pictures[v]);
        !ok)
      return ok;
  return {};
}

int follow(const FollowOptions& options) {
  if (const Status ok = check({{}, options.plot, options.pictures}); !ok)
    return fail(ok.error().message);
  if (!options.pictures.empty()) {
    std::error_code failed;
    std::filesystem::create_directories(options.pictures, failed);
    if (failed) return fail("cannot make folder " + options.pictures.string());
  }
  auto scene = load_for_eval(options.scene, options.set);
  if (!scene) return 1;
  if (scene->rate.model == RateConfig::Model::fixed) scene->rate.model = RateConfig::Model::ours;
  scene->rate.target_mbps = options.high_mbps;
  if (!(options.low_mbps > 0 && options.low_mbps <= options.high_mbps))
    return fail("--low must be above 0, and at most --high");
  const auto traces = rate::traces(options.low_mbps, options.high_mbps, options.seed);
  const auto trace = std::ranges::find(traces, options.trace, &rate::Trace::name);
  eval::RateRun run{*trace, options.seconds, options.views, {}};
  if (!options.pictures.empty())
    run.pictures = [&](int second, const std::vector<ImageRgb>& pictures) {
      return write_second(options.pictures, second, pictures);
    };
  int code = 0;
  in_arena(options, *scene, [&] {
    cli::ProgressBar bar;
    const auto seconds = eval::run_rate(*scene, run, quality_config(options, bar));
    bar.hide();
    if (!seconds) return void(code = fail(seconds.error().message));
    if (!options.plot.empty())
      if (const Status ok = write_file(options.plot, draw(*seconds, scene->id)); !ok)
        return void(code = fail(ok.error().message));
    fmt::print("{}", options.json ? to_json(*seconds).dump(2) + "\n" : to_text(*seconds));
  });
  return code;
}

}  // namespace

void add_eval_follow(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<FollowOptions>();
  CLI::App* command = eval.add_subcommand(
      "follow", "How a scene's stream follows a changing target, from its first capture on");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  command->add_option("--trace", options->trace, "How the target changes")
      ->check(CLI::IsMember({"constant", "steps", "ramp", "wifi", "cellular"}))
      ->capture_default_str();
  command->add_option("--low", options->low_mbps, "The lowest target, Mbit/s")
      ->capture_default_str();
  command->add_option("--high", options->high_mbps, "The highest target, Mbit/s")
      ->capture_default_str();
  command->add_option("--seconds", options->seconds, "Of the scene's time")
      ->check(CLI::Range(1, 3600))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Of the traces wifi and cellular")
      ->capture_default_str();
  command->add_option("--plot", options->plot, "Draw target and rate (SVG)");
  CLI::Option* views =
      command
          ->add_option("--views", options->views,
                       "Compare what is shown at the end of each second with the reference, from "
                       "so many of the scene's viewpoints")
          ->check(CLI::Range(0, 1000));
  command->add_option("--pictures", options->pictures, "Write what is shown there into this folder")
      ->needs(views);
  add_common_options(*command, *options);
  command->footer(
      "Examples:\n"
      "  meshreduce eval follow examples/eval/office-lively.yaml --trace steps --low 3 --high 12\n"
      "  meshreduce eval follow examples/eval/corridor.yaml --trace constant --high 2 --views 8");
  command->callback([options, &exit_code] { exit_code = follow(*options); });
}

}  // namespace mr::apps
