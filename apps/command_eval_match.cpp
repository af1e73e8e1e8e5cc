#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "eval_options.h"
#include "mr/core/file.h"
#include "mr/eval/operating_point.h"
#include "output.h"

namespace mr::apps {
namespace {

struct MatchOptions : EvalOptions {
  std::filesystem::path scene;
  eval::OperatingTarget target;
  std::vector<std::string> pipelines = baseline::pipeline_names();
};

struct Matches {
  eval::ReferenceKind reference;
  std::size_t views, moments;
  std::vector<eval::OperatingPoint> of;
};

Result<Matches> match_all(const Scene& scene, const MatchOptions& options) {
  cli::ProgressBar bar;
  const eval::QualityConfig config = quality_config(options, bar);
  const auto trial = eval::Trial::prepare(scene, config);
  if (!trial) return trial.error();
  Matches out{trial->reference(), trial->plan().views.size(), trial->all_moments().size(), {}};
  for (const std::string& pipeline : options.pipelines) {
    auto found = eval::find_operating_point(*trial, pipeline, options.target, config);
    if (!found) return found.error();
    out.of.push_back(*std::move(found));
  }
  return out;
}

std::string to_json(const Scene& scene, const Matches& matches) {
  nlohmann::ordered_json out;
  out["scene"] = scene.id, out["reference"] = to_string(matches.reference);
  out["views"] = matches.views, out["frames"] = matches.moments, out["fps"] = scene.fps;
  for (const eval::OperatingPoint& m : matches.of) {
    const eval::SweepPoint& p = m.point;
    out["systems"].push_back({{"pipeline", m.pipeline},
                              {"name", m.name},
                              {"met", m.met},
                              {"ranked", !is_reference(m.pipeline, matches.reference)},
                              {"mbps", p.mbps()},
                              {"refresh_mbps", p.refresh_mbps},
                              {"ssim", p.score.masked.mean},
                              {"ssim_p5", p.score.masked.p5},
                              {"psnr_db", p.score.psnr_db},
                              {"triangles", p.triangles},
                              {"voxel_m", p.geometry.voxel_m},
                              {"ratio", p.geometry.ratio},
                              {"step_exp", p.geometry.step_exp},
                              {"depth_qp", p.geometry.depth_qp},
                              {"texture_scale", p.texture.scale},
                              {"texture_qp", p.texture.qp},
                              {"fps", scene.fps / p.divider}});
  }
  return out.dump(2) + "\n";
}

/// The knobs that a pipeline has.
std::string knobs(const eval::OperatingPoint& m, double fps) {
  const eval::SweepPoint& p = m.point;
  const std::string voxel = fmt::format("voxel {:g} cm", 100 * p.geometry.voxel_m);
  const std::string coded =
      fmt::format("keep {:g} %, {} bits", 100 * p.geometry.ratio, -p.geometry.step_exp);
  const std::string texture = fmt::format("texture x{:g} QP {}", p.texture.scale, p.texture.qp);
  const std::string rate = fmt::format("{:g} fps", fps / p.divider);
  if (m.pipeline == "holoportation")
    return fmt::format("{}, texture x{:g}, {}", voxel, p.texture.scale, rate);
  if (m.pipeline == "holoportation++")
    return fmt::format("{}, {}, {}, {}", voxel, coded, texture, rate);
  if (m.pipeline == "points") return fmt::format("{}, {} bits", voxel, -p.geometry.step_exp);
  if (m.pipeline == "rgbd") return fmt::format("depth QP {}, {}", p.geometry.depth_qp, texture);
  return fmt::format("{}, {}", coded, texture);
}

int run_match(const MatchOptions& options) {
  if (options.target.mbps.has_value() == options.target.ssim.has_value())
    return misuse("give one of --mbps and --ssim");
  auto scene = load_for_eval(options.scene, options.set);
  if (!scene) return 1;
  scene->coding.frame_divider = 1;  // varied
  std::optional<Result<Matches>> matches;
  in_arena(options, *scene, [&] { matches.emplace(match_all(*scene, options)); });
  if (!*matches) return fail(matches->error().message);
  if (options.json) {
    fmt::print("{}", to_json(*scene, **matches));
    return 0;
  }
  fmt::print("{}, {} views at {} moment{}, against {}\n", scene->id, (*matches)->views,
             (*matches)->moments, (*matches)->moments == 1 ? "" : "s",
             to_string((*matches)->reference));
  for (const eval::OperatingPoint& m : (*matches)->of)
    fmt::print("{:<22} SSIM {:.3f} {:9.2f} Mbit/s{}{}  {}\n", m.name, m.point.score.masked.mean,
               m.point.mbps(), m.met ? " " : "!",
               is_reference(m.pipeline, (*matches)->reference) ? "*" : " ", knobs(m, scene->fps));
  fmt::print(
      "(! no setting that was tried meets the target: the nearest; * this system sends the "
      "reference itself: not to be ranked)\n");
  return 0;
}

}  // namespace

void add_eval_match(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<MatchOptions>();
  CLI::App* command = eval.add_subcommand(
      "match", "Each system's best setting within a rate, or its lowest rate for a quality");
  command->add_option("SCENE", options->scene, "Scene file (YAML)")->required();
  add_eval_options(*command, *options);
  auto* rate = command->add_option("--mbps", options->target.mbps, "At most so many Mbit/s")
                   ->check(between(0.001, 1e6));
  command->add_option("--ssim", options->target.ssim, "At least this Multi-View SSIM (masked)")
      ->check(between(0, 1))
      ->excludes(rate);
  command->add_option("--pipelines", options->pipelines, "Only these")
      ->delimiter(',')
      ->check(CLI::IsMember(baseline::pipeline_names()));
  command->footer(
      "Examples:\n"
      "  meshreduce eval match examples/eval/office-still.yaml --mbps 20\n"
      "  meshreduce eval match examples/eval/office-still.yaml --ssim 0.7 --pipelines "
      "meshreduce,points");
  command->callback([options, &exit_code] { exit_code = run_match(*options); });
}

}  // namespace mr::apps
