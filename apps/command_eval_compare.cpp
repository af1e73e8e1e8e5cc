#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "commands.h"
#include "eval_options.h"
#include "mr/core/file.h"
#include "mr/eval/quality.h"
#include "mr/kit/image_io.h"
#include "output.h"

namespace mr::apps {
namespace {

struct CompareOptions : EvalOptions {
  std::vector<std::filesystem::path> scenes;
  std::filesystem::path csv, pictures;
  int view = 0;
};

/// Pictures of one size in rows of three, each shown at half its size.
ImageRgb contact_sheet(const std::vector<ImageRgb>& pictures) {
  const int columns = 3, rows = (static_cast<int>(pictures.size()) + columns - 1) / columns;
  const int w = pictures.front().width / 2, h = pictures.front().height / 2;
  ImageRgb sheet(columns * w, rows * h, 255);
  for (std::size_t i = 0; i < pictures.size(); ++i)
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x)
        for (int c = 0; c < 3; ++c) {
          const ImageRgb& from = pictures[i];
          const int sum = from.at(2 * x, 2 * y)[c] + from.at(2 * x + 1, 2 * y)[c] +
                          from.at(2 * x, 2 * y + 1)[c] + from.at(2 * x + 1, 2 * y + 1)[c];
          const int column = static_cast<int>(i) % columns, row = static_cast<int>(i) / columns;
          sheet.at(column * w + x, row * h + y)[c] = static_cast<std::uint8_t>((sum + 2) / 4);
        }
  return sheet;
}

/// What is written at the end.
struct Table {
  std::string csv =
      "scene,pipeline,reference,ranked,triangles,ssim_masked,ssim_masked_p5,ssim_full,psnr_db,"
      "mesh_mbps,texture_mbps,mbps,refresh_mbps\n";
  std::vector<std::pair<std::filesystem::path, std::string>> pictures;
};

/// All pipelines of one scene; the reference's picture first.
Status compare_scene(const Scene& scene, const CompareOptions& options, Table& table) {
  cli::ProgressBar bar;
  const eval::QualityConfig config = quality_config(options, bar);
  const auto trial = eval::Trial::prepare(scene, config);
  if (!trial) return trial.error();
  const auto view = static_cast<std::size_t>(options.view), views = trial->plan().views.size();
  if (view >= views)
    return Error{Error::Cause::invalid, fmt::format("scene '{}' has viewpoints 0 to {}, and no {}",
                                                    scene.id, views - 1, view)};
  const auto metric = trial->metric(trial->all_moments(), trial->plan().views.size(), 1, config);
  if (!metric) return metric.error();
  const auto reference = trial->pictures({0}, view + 1, 0, config);
  if (!reference) return reference.error();
  std::vector<ImageRgb> sheet{reference->front()[view].color};
  for (const std::string& pipeline : baseline::pipeline_names()) {
    Scene variant = scene;
    variant.pipeline = pipeline;
    const auto system = eval::make_system(
        variant,
        {trial->moments(), config.rig_cache, config.eval_cache, {eval::geometry_setting(variant)}});
    if (!system) return system.error();
    const auto stream = eval::run_pipeline_halves(**system, variant, trial->moments(), config);
    if (!stream) return stream.error();
    std::vector<ImageRgb> pictures;
    const auto report = eval::measure_quality(*trial, *metric, variant, *stream, config, &pictures);
    if (!report) return report.error();
    sheet.push_back(std::move(pictures[view]));
    const auto& score = report->score;
    const bool ranked = !is_reference(pipeline, report->reference);
    table.csv += fmt::format(
        "{},{},{},{},{},{:.4f},{:.4f},{:.4f},{:.2f},{:.3f},{:.3f},{:.3f},{:.3f}\n", scene.id,
        pipeline, to_string(report->reference), ranked ? 1 : 0, report->triangles,
        score.masked.mean, score.masked.p5, score.full.mean, score.psnr_db, report->mesh_mbps,
        report->texture_mbps, report->mbps(), report->refresh_mbps);
    bar.hide();
    fmt::print("{:<22} {:<16} SSIM {:.3f}  {:9.2f} Mbit/s  {} {}{}\n", scene.id, pipeline,
               score.masked.mean, report->mbps(), report->triangles,
               pipeline == "points" ? "points" : "triangles",
               ranked ? "" : "  (not ranked: it sends the reference)");
    std::fflush(stdout);
  }
  if (options.pictures.empty()) return {};
  const auto jpeg = kit::encode_jpeg(contact_sheet(sheet), 85);
  if (!jpeg) return jpeg.error();
  table.pictures.emplace_back(
      options.pictures / (scene.id + ".jpg"),
      std::string(reinterpret_cast<const char*>(jpeg->data()), jpeg->size()));
  return {};
}

int compare(const CompareOptions& options) {
  if (const Status ok = check({{}, options.csv, options.pictures}); !ok)
    return fail(ok.error().message);
  std::vector<Scene> scenes;
  for (const auto& file : options.scenes) {
    auto scene = load_for_eval(file, options.set);
    if (!scene) return 1;
    scene->coding.frame_divider = 1;
    scenes.push_back(*std::move(scene));
  }
  Table table;
  for (const Scene& scene : scenes) {
    Status compared;
    in_arena(options, scene, [&] { compared = compare_scene(scene, options, table); });
    if (!compared) return fail(compared.error().message);
  }
  std::error_code failed;
  if (!options.pictures.empty()) std::filesystem::create_directories(options.pictures, failed);
  table.pictures.emplace_back(options.csv, table.csv);
  const Status written = write_all(table.pictures);
  return written ? 0 : fail(written.error().message);
}

}  // namespace

void add_eval_compare(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* command = eval.add_subcommand(
      "compare", "Our pipeline beside the four baselines, each with the scene's own settings");
  command->add_option("SCENES", options->scenes, "Scene files (YAML)")->required();
  add_eval_options(*command, *options);
  command->remove_option(command->get_option("--json"));
  command->add_option("--csv", options->csv, "Write the table");
  command->add_option("--pictures", options->pictures,
                      "Write one picture per scene into this folder: reference, meshreduce, "
                      "holoportation; holoportation++, points, rgbd");
  command->add_option("--view", options->view, "The viewpoint of those pictures")
      ->check(CLI::Range(0, 1000));
  command->footer(
      "Example:\n  meshreduce eval compare examples/eval/*.yaml --csv table.csv --pictures docs");
  command->callback([options, &exit_code] { exit_code = compare(*options); });
}

}  // namespace mr::apps
