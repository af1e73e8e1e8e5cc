#include "output.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdio>

#include "mr/baseline/ply_points.h"
#include "mr/baseline/run_baseline.h"
#include "mr/cli/command_line.h"
#include "mr/core/file.h"
#include "mr/core/parallel.h"
#include "mr/kit/image_io.h"
#include "mr/model/export.h"
#include "mr/render/renderer.h"
#include "mr/sensor/recording_formats.h"
#include "mr/synth/room.h"

namespace mr::apps {
namespace {

/// "frame 2/3 [=====>    ] view-4", on a terminal only and once two seconds have passed.
class ProgressLine {
 public:
  ~ProgressLine() {
    if (shown_) std::fputs("\r\x1b[K", stderr);
  }
  void show(int frame, int frames, const std::string& node) {
    if (!isatty(STDERR_FILENO) ||
        std::chrono::steady_clock::now() - start_ < std::chrono::seconds(2))
      return;
    constexpr int kWidth = 30;
    const int done = frames > 0 ? kWidth * frame / frames : 0;
    fmt::print(stderr, "\r\x1b[Kframe {}/{} [{:=<{}}>{: <{}}] {}", frame + 1, frames, "", done, "",
               kWidth - done, node);
    std::fflush(stderr);
    shown_ = true;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  bool shown_ = false;
};

Status write_snapshots(const DecodedScene& scene, Vec3d up, const std::filesystem::path& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed)
    return Error{Error::Cause::io,
                 "cannot make folder " + folder.string() + ": " + failed.message()};
  auto renderer = render::Renderer::create();
  if (!renderer) return renderer.error();
  for (const render::Viewpoint& view : render::overview(scene, up)) {
    auto picture =
        renderer->draw(scene, view.camera, view.T_world_camera, {.cull_back_faces = true});
    if (!picture) return picture.error();
    if (const Status written = kit::write_png(folder / (view.name + ".png"), *picture); !written)
      return written;
  }
  return {};
}

/// In lower case.
std::string ending_of(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return ending;
}

/// Points have no triangles, which all formats but .ply want.
Status write_model(const DecodedScene& scene, Vec3d up, const std::filesystem::path& file) {
  baseline::PointSet points;
  for (const auto& chunk : scene.chunks) {
    if (chunk->point_m <= 0) continue;
    points.positions.insert(points.positions.end(), chunk->mesh.positions.begin(),
                            chunk->mesh.positions.end());
    points.colors.insert(points.colors.end(), chunk->colors.begin(), chunk->colors.end());
  }
  if (points.positions.empty()) return model::export_scene(scene, up, file);
  if (ending_of(file) != ".ply")
    return Error{Error::Cause::unsupported,
                 "cannot export points to " + file.string() + ": use the ending .ply"};
  const Pose T = model::T_file_world(up);
  for (Vec3f& p : points.positions) p = vec_cast<float>(T * vec_cast<double>(p));
  return write_file(file, baseline::to_ply(points));
}

Result<RunOutcome> run_meshreduce(const Scene& scene, int frames,
                                  const runtime::RunListener& listener) {
  auto pipeline = runtime::LockstepScene::open(scene, synth::default_rig_cache());
  if (!pipeline) return pipeline.error();
  auto report = (*pipeline)->run(frames, listener);
  if (!report) return report.error();
  return RunOutcome{*std::move(report), *(*pipeline)->decoded()};
}

/// The scene's pipeline is one of the baselines.
Result<RunOutcome> run_other(const Scene& scene, int frames, const runtime::RunListener& listener) {
  auto run = baseline::run_baseline(scene, frames, 0, listener, synth::default_rig_cache());
  if (!run) return run.error();
  return RunOutcome{std::move(run->report), std::move(run->last)};
}

}  // namespace

int fail(const std::string& message) {
  fmt::print(stderr, "meshreduce: {}\n", message);
  return cli::kFailed;
}

int misuse(const std::string& message) {
  fail(message);
  return cli::kMisused;
}

int refused(const Error& error) {
  return error.cause == Error::Cause::unsupported ? misuse(error.message) : fail(error.message);
}

void add_set_option(CLI::App& command, std::vector<std::string>& set) {
  command
      .add_option("--set", set,
                  "Another value for a key of the scene, as often as needed: voxel_m=0.02, "
                  "merge.simplify.ratio=0.5, 'sensors.cam-0.depth_range_m=[0.3, 4]'")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
}

std::optional<Scene> usable_or_print_problems(SceneResult result) {
  for (const SceneProblem& problem : result.problems)
    fmt::print(stderr, "{}\n", to_string(problem));
  const auto in_file = std::count_if(result.problems.begin(), result.problems.end(),
                                     [](const SceneProblem& p) { return !p.option; });
  if (in_file > 1)
    fmt::print(stderr, "meshreduce: {} problems in {}; nothing was started\n", in_file,
               result.scene.file.string());
  if (!result.problems.empty()) return std::nullopt;
  for (const SceneProblem& notice : result.notices)
    fmt::print(stderr, "note: {}\n", to_string(notice));
  return std::move(result.scene);
}

std::optional<Scene> load_or_print_problems(const std::filesystem::path& file,
                                            const std::vector<std::string>& set) {
  if (const sensor::RecordingFormat* format = sensor::recognize(file)) {
    fail(fmt::format("{} is a recording ({}), no scene file: meshreduce import {} my.yaml",
                     file.string(), format->name, file.string()));
    return std::nullopt;
  }
  return usable_or_print_problems(load_scene(file, set));
}

Status check(const Outputs& outputs) {
  const std::string ending = ending_of(outputs.model);
  if (!outputs.model.empty() && ending != ".glb" && ending != ".ply" && ending != ".obj")
    return Error{Error::Cause::unsupported, "cannot export to " + outputs.model.string() +
                                                ": use the ending .glb, .ply or .obj"};
  const auto refuse = [](const std::filesystem::path& file, const std::string& why) {
    return Error{Error::Cause::not_found, "cannot write " + file.string() + ": " + why};
  };
  for (const auto& file : {outputs.model, outputs.report}) {
    if (file.empty()) continue;
    const auto folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
    if (!std::filesystem::is_directory(folder)) return refuse(file, "no folder " + folder.string());
    if (std::filesystem::is_directory(file)) return refuse(file, "it is a folder");
    if (::access(folder.c_str(), W_OK) != 0) return refuse(file, "no right to write to its folder");
  }
  if (std::filesystem::exists(outputs.snapshots) &&
      !std::filesystem::is_directory(outputs.snapshots))
    return refuse(outputs.snapshots, "it is not a folder");
  return {};
}

runtime::RunListener printing_listener() {
  runtime::RunListener listener;
  listener.dropped = [](const std::string& message) {
    fmt::print(stderr, "dropped: {}\n", message);
  };
  listener.warned = [](const std::string& message) {
    fmt::print(stderr, "warning: {}\n", message);
  };
  return listener;
}

Result<RunOutcome> run_scene(const Scene& scene, int frames, int threads) {
  std::optional<Result<RunOutcome>> outcome;
  Arena arena(threads > 0 ? threads : scene.threads);
  arena.run([&] {
    ProgressLine line;
    runtime::RunListener listener = printing_listener();
    listener.progress = [&](int frame, int of, const std::string& node) {
      line.show(frame, of, node);
    };
    outcome.emplace(scene.pipeline == "meshreduce" ? run_meshreduce(scene, frames, listener)
                                                   : run_other(scene, frames, listener));
    if (*outcome) (*outcome)->report.threads = arena.threads();
  });
  return *std::move(outcome);
}

Status write_outputs(const RunOutcome& outcome, const Scene& scene, const Outputs& outputs) {
  if (!outputs.model.empty())
    if (const Status written = write_model(outcome.last, scene.up, outputs.model); !written)
      return written;
  if (!outputs.report.empty())
    if (const Status written = write_file(outputs.report, to_json(outcome.report)); !written)
      return written;
  if (!outputs.snapshots.empty())
    if (const Status written = write_snapshots(outcome.last, scene.up, outputs.snapshots); !written)
      return written;
  return {};
}

}  // namespace mr::apps
