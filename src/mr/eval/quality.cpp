#include "mr/eval/quality.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "mr/baseline/monolithic.h"
#include "mr/baseline/run_baseline.h"
#include "mr/eval/seen_masks.h"
#include "mr/eval/store.h"
#include "mr/node/capture.h"
#include "mr/node/sources.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/synth/room.h"

namespace mr::eval {
namespace {

constexpr double kPlanVoxel_m = 0.03;

void show_progress(const QualityConfig& config, const std::string& step, std::size_t done,
                   std::size_t of) {
  if (config.progress) config.progress(step, done, of);
}

/// One burst of a scene's pipeline, decoded; the bytes of its captures are added to the rates.
struct Burst {
  std::vector<double> mesh_bytes, texture_bytes;
  std::optional<DecodedScene> shown;
};

Result<Burst> play_burst(const Scene& scene, int first, int frames, const QualityConfig& config) {
  Burst burst;
  runtime::RunListener listener;
  listener.dropped = listener.warned = config.notice;
  listener.sent = [&](int, std::uint64_t mesh, std::uint64_t texture) {
    burst.mesh_bytes.push_back(static_cast<double>(mesh));
    burst.texture_bytes.push_back(static_cast<double>(texture));
  };
  if (scene.pipeline == "meshreduce") {
    auto pipeline = runtime::LockstepScene::open(scene, config.rig_cache);
    if (!pipeline) return pipeline.error();
    (*pipeline)->skip(static_cast<std::uint64_t>(first));
    if (const auto report = (*pipeline)->run(frames, listener); !report) return report.error();
    burst.shown = (*pipeline)->decoded();
  } else {
    auto run = baseline::run_baseline(scene, frames, first, listener, config.rig_cache);
    if (!run) return run.error();
    burst.shown = std::move(run->last);
  }
  return burst;
}

/// One run of a pipeline with memory through all moments. Between them it is fed all captures, or
/// as many as the warm-up has.
class StatefulRun {
 public:
  StatefulRun(const Scene& scene, const Moments& moments, const QualityConfig& config)
      : scene_(scene), moments_(moments), config_(config), at_(moments.fed_from()) {
    listener_.dropped = listener_.warned = config.notice;
    listener_.captured = [this](int, const runtime::CaptureCost& cost) { costs_.push_back(cost); };
  }

  Result<DecodedStream> run() {
    auto pipeline = runtime::LockstepScene::open(scene_, config_.rig_cache);
    if (!pipeline) return pipeline.error();
    (*pipeline)->skip(static_cast<std::uint64_t>(at_));
    DecodedStream out;
    for (std::size_t m = 0; m < moments_.first.size(); ++m) {
      show_progress(config_, "stream", m, moments_.first.size());
      if (const Status stream = run_moment(**pipeline, m); !stream) return stream.error();
      out.shown.push_back(*(*pipeline)->decoded());
    }
    show_progress(config_, "stream", moments_.first.size(), moments_.first.size());
    out.mesh_mbps = mesh_.mbps(scene_.fps), out.texture_mbps = texture_.mbps(scene_.fps);
    out.refresh_mbps = refresh_bytes_ / static_cast<double>(out.shown.size()) * 8e-6;
    return out;
  }

 private:
  Status run_moment(runtime::LockstepScene& pipeline, std::size_t moment) {
    const int end = moments_.shown(moment) + moments_.later() + 1;
    const int second = std::max(moments_.burst, static_cast<int>(std::lround(scene_.fps)));
    int between = std::max(0, end - at_ - second);
    if (moment > 0 && between > moments_.warm_up) {
      pipeline.skip(static_cast<std::uint64_t>(between - moments_.warm_up));
      at_ += between - moments_.warm_up, between = moments_.warm_up;
    }
    if (between > 0)
      if (const auto ran = pipeline.run(between, listener_); !ran) return ran.error();
    // The moving layer has as many key frames as the baselines; the plates' give the cost of a
    // refresh.
    pipeline.ask_key_frames({node::RootAtlas::kLiveStream, node::RootAtlas::kPlateStream});
    costs_.clear();
    const auto report = pipeline.run(end - at_ - between, listener_);
    if (!report) return report.error();
    at_ = end;
    std::vector<double> mesh, texture;
    for (const runtime::CaptureCost& cost : costs_) {
      mesh.push_back(static_cast<double>(cost.mesh_bytes + cost.head_bytes));
      texture.push_back(static_cast<double>(cost.texture_bytes));
    }
    if (costs_.empty())
      return Error{Error::Cause::empty,
                   fmt::format("scene '{}' has no capture {}", scene_.id, end)};
    const auto plates = static_cast<double>(costs_.front().plate_bytes);
    texture.front() -= plates;
    mesh_.add_steady(mesh), texture_.add_burst(texture);
    refresh_bytes_ += static_cast<double>(report->refresh_bytes) + plates;
    return {};
  }

  const Scene& scene_;
  const Moments& moments_;
  const QualityConfig& config_;
  int at_;  ///< the next capture
  runtime::RunListener listener_;
  std::vector<runtime::CaptureCost> costs_;  ///< of the newest captures
  Rate mesh_, texture_;
  double refresh_bytes_ = 0;
};

/// A burst that ends with a capture that is sent.
int burst_of(int burst, int divider) { return 1 + divider * ((burst + divider - 2) / divider); }

std::uint64_t triangles_of(const DecodedScene& scene) {
  std::uint64_t triangles = 0, points = 0;
  for (const auto& chunk : scene.chunks) {
    triangles += chunk->mesh.triangles.size();
    if (chunk->point_m > 0) points += chunk->mesh.positions.size();
  }
  return triangles > 0 ? triangles : points;
}

nlohmann::ordered_json json_of(const ScoreStatistics& statistics) {
  return {{"mean", statistics.mean}, {"p5", statistics.p5}, {"min", statistics.min}};
}

}  // namespace

Result<ViewPlan> plan_scene(const Scene& scene, const std::filesystem::path& rig_cache) {
  node::CaptureReader reader(scene, rig_cache);
  const auto capture = reader.next();
  if (!capture || capture->empty())
    return Error{Error::Cause::empty, "scene '" + scene.id + "' has no capture"};
  const Mesh captured = baseline::fuse_all(scene, *capture, kPlanVoxel_m);
  std::vector<Pose> sensors;
  for (const Frame& frame : *capture) sensors.push_back(frame.T_world_depth);
  return plan_viewpoints(captured, sensors, scene.up);
}

std::filesystem::path viewpoints_file(const Scene& scene) {
  return std::filesystem::path(scene.file).replace_extension(".views.json");
}

Result<ViewPlan> scene_viewpoints(const Scene& scene, const std::filesystem::path& rig_cache,
                                  const std::function<void(const std::string&)>& notice) {
  const auto file = viewpoints_file(scene);
  if (!std::filesystem::exists(file)) return plan_scene(scene, rig_cache);
  auto plan = read_viewpoints(file, viewpoints_key(scene));
  if (plan) return plan;
  if (plan.error().cause != Error::Cause::not_found && notice)
    notice(plan.error().message + "; planning afresh (eval views writes it)");
  return plan_scene(scene, rig_cache);
}

std::string viewpoints_key(const Scene& scene) {
  Fingerprint print;
  print.add(scene.up.x).add(scene.up.y).add(scene.up.z);
  if (scene.rig) print.add(static_cast<double>(synth::rig_key(*scene.rig, scene.fps)));
  for (const SensorConfig& sensor : scene.sensors) {
    print.add(sensor.depth_camera).add(sensor.depth_near_m).add(sensor.depth_far_m);
    for (const Pose& pose : sensor.T_world_depth) print.add(pose);
  }
  return print.hex();
}

Result<Trial> Trial::prepare(const Scene& scene, const QualityConfig& config) {
  Trial trial;
  auto prepared = node::prepare_scene(scene);
  if (!prepared) return prepared.error();
  trial.scene_ = *std::move(prepared);
  const bool any_color =
      std::any_of(trial.scene_.sensors.begin(), trial.scene_.sensors.end(),
                  [](const SensorConfig& sensor) { return sensor.color_camera.has_value(); });
  if (!any_color)
    return Error{Error::Cause::empty,
                 "scene '" + scene.id + "' has no colour, so pictures of it cannot be compared"};
  trial.moments_ = spread_moments(trial.scene_, config.moments, config.burst);
  const auto moments = static_cast<int>(trial.moments_.first.size());
  if ((moments < config.moments || trial.moments_.burst < config.burst) && config.notice)
    config.notice(fmt::format("the sources hold {} moment{} of {} capture{}", moments,
                              moments == 1 ? "" : "s", trial.moments_.burst,
                              trial.moments_.burst == 1 ? "" : "s"));
  trial.reference_ = config.reference.value_or(default_reference(trial.scene_));
  if (trial.reference_ == ReferenceKind::truth && !known_rig(trial.scene_)) return no_truth(scene);

  auto plan = scene_viewpoints(trial.scene_, config.rig_cache, config.notice);
  if (!plan) return plan.error();
  trial.plan_ = *std::move(plan);

  trial.moments_.burst = burst_of(trial.moments_.burst, frame_divider(scene));
  return trial;
}

std::vector<std::size_t> Trial::all_moments() const {
  std::vector<std::size_t> all(moments_.first.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

Result<std::vector<std::vector<RenderedView>>> Trial::pictures(
    const std::vector<std::size_t>& moments, std::size_t views, int captures_later,
    const QualityConfig& config) const {
  std::vector<int> frames;
  for (const std::size_t m : moments) frames.push_back(moments_.shown(m) + captures_later);
  std::vector<render::Viewpoint> from = plan_.views;
  from.resize(std::min(views, from.size()));
  return reference_pictures(
      scene_, reference_, frames, from, config.rig_cache, config.eval_cache,
      [&](std::size_t done, std::size_t of) { show_progress(config, "reference", done, of); });
}

Result<MultiViewSsim> Trial::metric(const std::vector<std::size_t>& moments, std::size_t views,
                                    int divider, const QualityConfig& config,
                                    bool with_seen) const {
  const int younger = (divider - 1) / 2, older = divider / 2;
  MultiViewSsim metric;
  std::vector<std::vector<ImageMask>> seen;
  if (with_seen && reference_ == ReferenceKind::truth) {
    std::vector<render::Viewpoint> from = plan_.views;
    from.resize(std::min(views, from.size()));
    auto masks = seen_masks(
        scene_, moments_, moments, from, config.eval_cache,
        [&](std::size_t done, std::size_t of) { show_progress(config, "seen", done, of); });
    if (!masks) return masks.error();
    seen = *std::move(masks);
  }
  for (int age = younger; age <= older; ++age) {
    const auto reference = pictures(moments, views, age, config);
    if (!reference) return reference.error();
    if (const Status added = metric.add(*reference, seen); !added) return added.error();
  }
  return metric;
}

int frame_divider(const Scene& scene) {
  return scene.pipeline == "meshreduce" ? 1 : scene.coding.frame_divider;
}

Result<DecodedStream> run_pipeline(const Scene& scene, const Moments& moments,
                                   const QualityConfig& config) {
  if (moments.burst == 1 && config.notice)
    config.notice("the sources hold one capture: the rate is that of sending it afresh each time");
  if (is_stateful(scene)) return StatefulRun(scene, moments, config).run();
  DecodedStream out;
  Rate mesh, texture;
  for (std::size_t m = 0; m < moments.first.size(); ++m) {
    show_progress(config, "stream", m, moments.first.size());
    auto burst = play_burst(scene, moments.first[m], moments.burst, config);
    if (!burst) return burst.error();
    mesh.add_burst(burst->mesh_bytes);
    texture.add_burst(burst->texture_bytes);
    out.shown.push_back(*std::move(burst->shown));
  }
  show_progress(config, "stream", moments.first.size(), moments.first.size());
  out.mesh_mbps = mesh.mbps(scene.fps), out.texture_mbps = texture.mbps(scene.fps);
  return out;
}

Result<DecodedStream> run_pipeline_halves(System& system, const Scene& scene,
                                          const Moments& moments, const QualityConfig& config) {
  DecodedStream out;
  Rate mesh, texture;
  double refresh_bytes = 0;
  for (std::size_t m = 0; m < moments.first.size(); ++m) {
    show_progress(config, system.name(), m, moments.first.size());
    auto geometry = system.geometry(geometry_setting(scene), m);
    if (!geometry) return geometry.error();
    auto pictures = system.texture(texture_setting(scene), m);
    if (!pictures) return pictures.error();
    geometry->cost.add_to(mesh), pictures->cost.add_to(texture);
    refresh_bytes += geometry->cost.refresh_bytes + pictures->cost.refresh_bytes;
    out.shown.push_back(
        baseline::join(std::move(geometry->decoded), std::move(pictures->decoded), {}));
  }
  out.refresh_mbps = refresh_bytes / static_cast<double>(moments.first.size()) * 8e-6;
  out.mesh_mbps = mesh.mbps(scene.fps), out.texture_mbps = texture.mbps(scene.fps);
  return out;
}

Result<QualityReport> measure_quality(const Trial& trial, const MultiViewSsim& metric,
                                      const Scene& scene, const DecodedStream& stream,
                                      const QualityConfig& config,
                                      std::vector<ImageRgb>* pictures) {
  auto renderer = render::Renderer::create();
  if (!renderer) return renderer.error();
  QualityReport report;
  report.scene = scene.id, report.pipeline = scene.pipeline, report.reference = trial.reference();
  report.fps = scene.fps;
  report.views = static_cast<int>(trial.plan().views.size());
  report.frames = static_cast<int>(stream.shown.size());
  report.mesh_mbps = stream.mesh_mbps, report.texture_mbps = stream.texture_mbps;
  report.refresh_mbps = stream.refresh_mbps;
  report.triangles = triangles_of(stream.shown.back());
  std::vector<std::vector<PictureScore>> scores(stream.shown.size());
  const std::size_t all = stream.shown.size() * trial.plan().views.size();
  for (std::size_t m = 0; m < stream.shown.size(); ++m)
    for (std::size_t v = 0; v < trial.plan().views.size(); ++v) {
      show_progress(config, "compare", m * trial.plan().views.size() + v, all);
      auto drawn = draw_scene(*renderer, stream.shown[m], trial.plan().views[v]);
      if (!drawn) return drawn.error();
      const auto score = metric.compare(m, v, luma_of(drawn->color), drawn->covered);
      if (!score) return score.error();
      scores[m].push_back(*score);
      if (pictures && m == 0) pictures->push_back(std::move(drawn->color));
    }
  show_progress(config, "compare", all, all);
  report.score = summarize(scores, metric.has_seen_masks());
  return report;
}

std::string to_json(const QualityReport& r) {
  nlohmann::ordered_json out;
  out["scene"] = r.scene, out["pipeline"] = r.pipeline, out["reference"] = to_string(r.reference);
  out["views"] = r.views, out["frames"] = r.frames, out["fps"] = r.fps, out["mbps"] = r.mbps();
  out["mesh_mbps"] = r.mesh_mbps, out["texture_mbps"] = r.texture_mbps;
  out["refresh_mbps"] = r.refresh_mbps;
  out["triangles"] = r.triangles;
  out["psnr_db"] = r.score.psnr_db;
  out["ssim"] = {{"masked", json_of(r.score.masked)}, {"full", json_of(r.score.full)}};
  if (r.score.seen) out["ssim"]["seen"] = json_of(*r.score.seen);
  out["ssim_by_view"] = r.score.masked_views;
  return out.dump(2) + "\n";
}

std::string to_text(const QualityReport& r) {
  const auto line = [](const char* name, const ScoreStatistics& s) {
    return fmt::format("  SSIM {}  {:.4f} mean, {:.4f} 5th percentile, {:.4f} least\n", name,
                       s.mean, s.p5, s.min);
  };
  return fmt::format("{} ({}), {} views at {} moment{}, against {}\n", r.scene, r.pipeline, r.views,
                     r.frames, r.frames == 1 ? "" : "s",
                     r.reference == ReferenceKind::truth ? "the truth" : "the monolithic fusion") +
         line("masked", r.score.masked) + line("full  ", r.score.full) +
         (r.score.seen ? line("seen  ", *r.score.seen) : "") +
         fmt::format("  PSNR         {:.2f} dB\n", r.score.psnr_db) +
         fmt::format("  rate         {:.2f} Mbit/s at {:g} fps: mesh {:.2f}, texture {:.2f}\n",
                     r.mbps(), r.fps, r.mesh_mbps, r.texture_mbps) +
         (r.refresh_mbps > 0
              ? fmt::format(
                    "  refresh      {:.2f} Mbit/s more with all chunks and plates once a second\n",
                    r.refresh_mbps)
              : "") +
         fmt::format("  {:<13}{}\n", r.pipeline == "points" ? "points" : "triangles", r.triangles);
}

}  // namespace mr::eval
