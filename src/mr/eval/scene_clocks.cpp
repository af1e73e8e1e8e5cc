#include "mr/eval/scene_clocks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/calib/clock_offsets.h"
#include "mr/core/parallel.h"
#include "mr/node/sources.h"
#include "mr/sensor/registration.h"
#include "mr/synth/rig_errors.h"

namespace mr::eval {
namespace {

constexpr auto kBefore = std::chrono::milliseconds(500);  // as clocks are off
constexpr int kMostLost = 1000;                           // frames in a row

/// One sensor's pictures, undistorted.
class ClockReader {
 public:
  ClockReader(const SensorConfig& sensor, SensorId id, std::unique_ptr<FrameSource> source)
      : sensor_(sensor), registration_(sensor, id), source_(std::move(source)) {}

  /// The first picture after `skipped` stays for read(). False: there is none, or it cannot be
  /// compared.
  bool begin(std::uint64_t skipped) {
    if (sensor_.is_moving()) return refuse("it moves itself");
    if (registration_.depth_camera().model != CameraModel::pinhole)
      return refuse("a LiDAR's sweep has no single moment");
    source_->skip(skipped);
    first_ = next();
    return first_ || refuse(problem.empty() ? "it has no pictures" : problem);
  }

  TimePoint first_at() const { return first_->captured_at(); }

  void read(TimePoint from, TimePoint until) {
    track = calib::make_depth_track(registration_.depth_camera(), first_->T_world_depth,
                                    sensor_.precision);
    for (auto frame = std::move(first_); frame && frame->captured_at() <= until; frame = next()) {
      if (frame->captured_at() < from) continue;
      drop_out_of_range(*frame);
      calib::append(track, frame->captured_at(), frame->depth);
    }
  }

  calib::DepthTrack track;
  std::string problem;

 private:
  bool refuse(std::string why) {
    problem = std::move(why);
    return false;
  }

  std::optional<Frame> next() {
    for (int lost = 0; lost < kMostLost; ++lost) {
      auto frame = source_->next();
      if (frame && !*frame) return std::nullopt;
      if (frame) return registration_.undistort(**std::move(frame));
      problem = frame.error().message;
    }
    return std::nullopt;
  }

  void drop_out_of_range(Frame& frame) const {
    for (float& depth : frame.depth.data)
      if (!(depth >= static_cast<float>(sensor_.depth_near_m) &&
            depth <= static_cast<float>(sensor_.depth_far_m)))
        depth = 0;
  }

  const SensorConfig& sensor_;
  sensor::Registration registration_;
  std::unique_ptr<FrameSource> source_;
  std::optional<Frame> first_;
};

/// The pictures of all sensors that can be compared, over the same time.
std::vector<ClockReader> read_tracks(const Scene& scene, const std::filesystem::path& rig_cache,
                                     const ClockSpan& span) {
  const std::vector<SensorId> wanted = all_sensors(scene.sensors);
  auto sources = node::open_sources(scene, wanted, rig_cache);
  std::vector<ClockReader> readers;
  for (const SensorId id : wanted)
    readers.emplace_back(scene.sensor(id), id, std::move(sources[index_of(id)]));
  const auto skipped = static_cast<std::uint64_t>(std::llround(span.from_s * scene.fps));
  std::optional<TimePoint> begin;
  std::vector<ClockReader*> usable;
  for (ClockReader& reader : readers) {
    if (!reader.begin(skipped)) continue;
    begin = std::max(begin.value_or(reader.first_at()), reader.first_at());
    usable.push_back(&reader);
  }
  if (!begin) return readers;
  const TimePoint until =
      *begin + std::chrono::duration_cast<Duration>(std::chrono::duration<double>(span.seconds));
  parallel_for(usable.size(), 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) usable[i]->read(*begin - kBefore, until);
  });
  return readers;
}

/// By how much a sensor of a rig truly captures later than its frames say.
std::optional<double> true_offset_ms(const Scene& scene, const SensorConfig& sensor) {
  const RigConfig* rig = scene.rig                         ? &*scene.rig
                         : scene.truth && scene.truth->rig ? &*scene.truth->rig
                                                           : nullptr;
  if (rig == nullptr) return std::nullopt;
  const std::vector<std::string> ids = rig->sensor_ids();
  const auto at = std::ranges::find(ids, sensor.id);
  if (at == ids.end()) return std::nullopt;
  return 1000 * synth::clock_error_s(*rig, static_cast<std::uint32_t>(at - ids.begin())) -
         sensor.clock_offset_ms;
}

double span_s(const calib::DepthTrack& track) {
  return track.times.empty()
             ? 0
             : std::chrono::duration<double>(track.times.back() - track.times.front()).count();
}

SensorClock clock_of(const SensorConfig& sensor, const calib::ClockOffset& estimate,
                     const std::string& unread) {
  SensorClock out;
  out.id = sensor.id;
  if (estimate.offset_s) out.offset_ms = 1000 * *estimate.offset_s;
  out.sigma_ms = 1000 * estimate.sigma_s;
  out.overlap_points = estimate.shared_points;
  out.clock_offset_ms = sensor.clock_offset_ms + out.offset_ms.value_or(0);
  if (!out.offset_ms) out.problem = unread.empty() ? estimate.problem : unread;
  return out;
}

}  // namespace

SceneClocks compare_clocks(const Scene& scene, const std::filesystem::path& rig_cache,
                           const ClockSpan& span) {
  const auto readers = read_tracks(scene, rig_cache, span);
  SceneClocks out;
  std::vector<calib::DepthTrack> tracks;
  std::vector<std::string> unread;
  for (const ClockReader& reader : readers) {
    tracks.push_back(reader.track);
    unread.push_back(reader.track.times.empty() ? reader.problem : "");
    out.frames = std::max(out.frames, reader.track.times.size());
    out.seconds = std::max(out.seconds, span_s(reader.track));
  }
  const calib::ClockEstimate estimate = calib::estimate_clock_offsets(tracks);
  out.problem = estimate.problem;
  for (std::size_t i = 0; i < tracks.size(); ++i)
    out.clocks.push_back(clock_of(scene.sensors[i], estimate.clocks[i], unread[i]));
  for (const calib::ClockPair& pair : estimate.pairs)
    out.pairs.push_back({scene.sensors[pair.a].id, scene.sensors[pair.b].id, 1000 * pair.offset_s,
                         1000 * pair.sigma_s, pair.points});
  if (!estimate.reference) return out;
  const SensorConfig& reference = scene.sensors[*estimate.reference];
  out.reference = reference.id;
  const auto reference_ms = true_offset_ms(scene, reference);
  for (std::size_t i = 0; i < tracks.size(); ++i)
    if (const auto truth_ms = true_offset_ms(scene, scene.sensors[i]); truth_ms && reference_ms)
      out.clocks[i].true_ms = *truth_ms - *reference_ms;
  return out;
}

}  // namespace mr::eval
