#include "mr/baseline/run_baseline.h"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <optional>

#include "mr/node/sources.h"
#include "mr/sensor/registration.h"

namespace mr::baseline {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// What one capture has become.
struct DecodedCapture {
  DecodedScene scene;
  std::size_t geometry_bytes = 0, texture_bytes = 0;
};

class Runner {
 public:
  Runner(const Scene& scene, Baseline& baseline, const runtime::RunListener& listener,
         const std::filesystem::path& cache_folder)
      : scene_(scene), baseline_(baseline), listener_(listener) {
    const std::vector<SensorId> all = all_sensors(scene.sensors);
    sources_ = node::open_sources(scene, all, cache_folder);
    for (const SensorId id : all) registrations_.emplace_back(scene.sensor(id), id);
    drops_.set_listener([&](const std::string& place, const Error& error) {
      if (listener_.dropped) listener_.dropped(place + ": " + error.message);
    });
  }

  Result<BaselineRun> run(int frames, int first_frame);

 private:
  bool capture(std::vector<Frame>& frames);
  void undistort(std::vector<Frame>& frames);
  bool send(std::vector<Frame> frames);
  Result<DecodedCapture> code(std::span<const Frame> frames);
  BaselineRun report(int captures, double seconds);

  const Scene& scene_;
  Baseline& baseline_;
  const runtime::RunListener& listener_;
  std::vector<std::unique_ptr<FrameSource>> sources_;
  std::vector<sensor::Registration> registrations_;
  DropCounter drops_;
  Trace sensors_;
  std::optional<DecodedCapture> shown_;
  int frames_ = 0, last_frame_ = -1;
  std::uint64_t geometry_bytes_ = 0, texture_bytes_ = 0, chunks_ = 0;
  double register_ms_ = 0;  // the slowest sensor's, of the newest capture
  CallTimes calls_;         // of the newest capture
  std::vector<double> end_to_end_ms_, critical_path_ms_;
};

/// One frame of every source that delivers one; false when all have ended.
bool Runner::capture(std::vector<Frame>& frames) {
  frames.clear();
  bool any = false;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    auto frame = sources_[i]->next();
    any |= !frame || frame->has_value();
    if (!frame && !is_gap(frame.error())) drops_.count(scene_.sensors[i].id, frame.error());
    if (frame && *frame) frames.push_back(**std::move(frame));
  }
  return any;
}

/// What every sensor does beside itself, one after another.
void Runner::undistort(std::vector<Frame>& frames) {
  register_ms_ = 0;
  for (Frame& frame : frames) {
    const auto start = Clock::now();
    frame = registrations_[index_of(frame.sensor)].undistort(std::move(frame));
    register_ms_ = std::max(register_ms_, ms_since(start));
    sensors_.add("register", ms_since(start));
  }
}

Result<DecodedCapture> Runner::code(std::span<const Frame> frames) {
  const auto timed = [](double& ms, auto&& call) {
    ms = 0;
    const Stopwatch stopwatch(ms);
    return call();
  };
  const auto mesh =
      timed(calls_.encode_geometry_ms, [&] { return baseline_.encode_geometry(frames); });
  const auto pictures =
      timed(calls_.encode_texture_ms, [&] { return baseline_.encode_texture(frames); });
  // What was coded is decoded, whatever became of the rest: video goes on from call to call.
  auto geometry = timed(calls_.decode_geometry_ms, [&]() -> Result<Geometry> {
    if (!mesh) return mesh.error();
    return baseline_.decode_geometry(*mesh);
  });
  auto texture = timed(calls_.decode_texture_ms, [&]() -> Result<Texture> {
    if (!pictures) return pictures.error();
    return baseline_.decode_texture(*pictures);
  });
  if (!geometry) return geometry.error();
  if (!texture) return texture.error();
  TimePoint captured_at{};
  for (const SourceInfo& source : geometry->sources)
    captured_at = std::max(captured_at, source.captured_at);
  return DecodedCapture{join(*std::move(geometry), *std::move(texture), captured_at), mesh->size(),
                        pictures->size()};
}

/// Whether the capture came through; else it is counted, or all its frames were.
bool Runner::send(std::vector<Frame> frames) {
  if (frames.empty()) return false;
  const auto start = Clock::now();
  undistort(frames);
  auto shown = code(frames);
  if (!shown) {
    drops_.count(baseline_.name(), shown.error());
    return false;
  }
  end_to_end_ms_.push_back(ms_since(start));
  critical_path_ms_.push_back(register_ms_ + baseline_.critical_path_ms(calls_));
  geometry_bytes_ += shown->geometry_bytes, texture_bytes_ += shown->texture_bytes;
  chunks_ += shown->scene.chunks.size();
  shown_ = *std::move(shown);
  return true;
}

Result<BaselineRun> Runner::run(int frames, int first_frame) {
  for (const auto& source : sources_) source->skip(static_cast<std::uint64_t>(first_frame));
  const auto start = Clock::now();
  std::vector<Frame> captured;
  int captures = 0;
  for (; captures < frames && capture(captured); ++captures) {
    if (listener_.progress) listener_.progress(captures, frames, baseline_.name());
    const bool left_out = captures % scene_.coding.frame_divider != 0;
    if (left_out ? !shown_ : !send(std::move(captured))) continue;
    ++frames_, last_frame_ = captures;
    if (listener_.sent)
      listener_.sent(captures, left_out ? 0 : shown_->geometry_bytes,
                     left_out ? 0 : shown_->texture_bytes);
    if (listener_.shown) listener_.shown(captures, shown_->scene);
  }
  if (!shown_)
    return Error{Error::Cause::empty, "scene '" + scene_.id + "': no frame came through (" +
                                          std::to_string(drops_.by_cause().size()) +
                                          " causes of drops)"};
  return report(captures, ms_since(start) / 1000);
}

BaselineRun Runner::report(int captures, double seconds) {
  runtime::RunReport r;
  r.scene = scene_.id;
  r.preset = runtime::preset_of(scene_);
  r.frames = frames_, r.last_frame = last_frame_;
  r.fps = frames_ / seconds;
  r.sensors = static_cast<int>(scene_.sensors.size());
  r.peak_rss_mb = runtime::peak_rss_mb();
  for (const auto& chunk : shown_->scene.chunks) {
    r.triangles += chunk->mesh.triangles.size();
    r.vertices += chunk->mesh.positions.size();
  }
  r.mesh_bytes_per_frame = static_cast<double>(geometry_bytes_) / captures;
  r.texture_bytes_per_frame = static_cast<double>(texture_bytes_) / captures;
  r.refresh_bytes = shown_->geometry_bytes;  // every capture is whole
  r.chunks_new = chunks_;
  r.drops = drops_.by_cause();
  r.sensor_stages_ms = sensors_.stages();
  r.merge_stages_ms = baseline_.trace().stages();
  r.critical_path_ms = percentile(critical_path_ms_, 0.5);
  r.end_to_end_ms = end_to_end_ms_;
  return {std::move(r), std::move(shown_->scene)};
}

}  // namespace

Result<BaselineRun> run_baseline(const Scene& given, int frames, int first_frame,
                                 const runtime::RunListener& listener,
                                 const std::filesystem::path& cache_folder) {
  const auto scene = node::prepare_scene(given);
  if (!scene) return scene.error();
  const auto baseline = make_baseline(*scene);
  if (!baseline) return baseline.error();
  Runner runner(*scene, **baseline, listener, cache_folder);
  return runner.run(frames, first_frame);
}

}  // namespace mr::baseline
