#include <fmt/format.h>

#include <memory>

#include "commands.h"
#include "eval_options.h"
#include "mr/core/file.h"
#include "mr/eval/quality.h"
#include "mr/kit/image_io.h"
#include "output.h"

namespace mr::apps {
namespace {

struct SsimOptions : EvalOptions {
  std::vector<std::filesystem::path> files;
  std::string pipeline;
  std::filesystem::path pictures;
};

bool is_picture(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  return ending == ".png" || ending == ".jpg" || ending == ".jpeg";
}

int compare_pictures(const SsimOptions& options) {
  if (!options.pipeline.empty() || !options.reference.empty() || !options.pictures.empty() ||
      !options.set.empty())
    return misuse(
        "--pipeline, --reference, --pictures and --set are for scenes, not for two pictures");
  std::vector<eval::ImageLuma> lumas;
  for (const auto& file : options.files) {
    const auto picture = kit::read_color(file);
    if (!picture) return fail(picture.error().message);
    lumas.push_back(eval::luma_of(*picture));
  }
  if (lumas[0].width != lumas[1].width || lumas[0].height != lumas[1].height)
    return fail(fmt::format("pictures differ in size: {}x{} and {}x{}", lumas[0].width,
                            lumas[0].height, lumas[1].width, lumas[1].height));
  const auto reference = eval::Ssim::prepare(std::move(lumas[1]));
  if (!reference) return fail(reference.error().message);
  const auto score = reference->compare(lumas[0]);
  if (!score) return fail(score.error().message);
  if (options.json)
    fmt::print("{{\"ssim\": {:.6f}, \"psnr_db\": {:.4f}}}\n", score->ssim_full, score->psnr_db);
  else
    fmt::print("SSIM {:.4f}, PSNR {:.2f} dB\n", score->ssim_full, score->psnr_db);
  return 0;
}

/// The first moment's pictures beside those of the reference: view-00.png, view-00-reference.png, …
Status write_pictures(const eval::Trial& trial, const std::vector<ImageRgb>& pictures,
                      const eval::QualityConfig& config, const std::filesystem::path& folder) {
  const auto references = trial.pictures({0}, pictures.size(), 0, config);
  if (!references) return references.error();
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) return Error{Error::Cause::io, "cannot make folder " + folder.string()};
  for (std::size_t v = 0; v < pictures.size(); ++v) {
    const std::string& name = trial.plan().views[v].name;
    const auto& reference = references->front()[v].color;
    if (auto ok = kit::write_png(folder / (name + ".png"), pictures[v]); !ok) return ok;
    if (auto ok = kit::write_png(folder / (name + "-reference.png"), reference); !ok) return ok;
  }
  return {};
}

int measure_scene(const SsimOptions& options) {
  if (is_picture(options.files.front()))
    return misuse("one picture cannot be compared: name two, or a scene file");
  if (const Status ok = check({{}, {}, options.pictures}); !ok) return fail(ok.error().message);
  auto scene = load_for_eval(options.files.front(), options.set);
  if (!scene) return 1;
  if (!options.pipeline.empty()) scene->pipeline = options.pipeline;
  int code = 0;
  in_arena(options, *scene, [&] {
    cli::ProgressBar bar;
    const eval::QualityConfig config = quality_config(options, bar);
    const auto trial = eval::Trial::prepare(*scene, config);
    if (!trial) return void(code = fail(trial.error().message));
    const auto stream = eval::run_pipeline(*scene, trial->moments(), config);
    if (!stream) return void(code = fail(stream.error().message));
    std::vector<ImageRgb> pictures;
    const auto metric = trial->metric(trial->all_moments(), trial->plan().views.size(),
                                      eval::frame_divider(*scene), config, true);
    if (!metric) return void(code = fail(metric.error().message));
    const auto report = eval::measure_quality(*trial, *metric, *scene, *stream, config, &pictures);
    if (!report) return void(code = fail(report.error().message));
    if (!options.pictures.empty())
      if (const Status ok = write_pictures(*trial, pictures, config, options.pictures); !ok)
        return void(code = fail(ok.error().message));
    bar.hide();
    fmt::print("{}", options.json ? eval::to_json(*report) : eval::to_text(*report));
  });
  return code;
}

}  // namespace

void add_eval_ssim(CLI::App& eval, int& exit_code) {
  auto options = std::make_shared<SsimOptions>();
  CLI::App* command = eval.add_subcommand(
      "ssim",
      "Multi-View SSIM of a scene's stream as a client decodes it; or SSIM of two pictures");
  command->add_option("FILES", options->files, "A scene file (YAML); or two pictures of one size")
      ->required()
      ->expected(1, 2);
  add_eval_options(*command, *options);
  command
      ->add_option("--pipeline", options->pipeline,
                   "Measure this pipeline rather than the scene's: meshreduce, holoportation, "
                   "holoportation++, points, rgbd")
      ->check(CLI::IsMember(baseline::pipeline_names()));
  command->add_option("--pictures", options->pictures,
                      "Write the first moment's pictures, and the reference's, into this folder");
  command->footer(
      "Examples:\n"
      "  meshreduce eval ssim examples/eval/office-still.yaml --json\n"
      "  meshreduce eval ssim rendered.png reference.png");
  command->callback([options, &exit_code] {
    exit_code = options->files.size() == 2 ? compare_pictures(*options) : measure_scene(*options);
  });
}

}  // namespace mr::apps
