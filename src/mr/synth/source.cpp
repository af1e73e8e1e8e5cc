#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <numbers>
#include <string>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/synth/hash.h"
#include "mr/synth/rig_errors.h"
#include "mr/synth/room.h"
#include "mr/synth/sensor_effects.h"
#include "mr/synth/shot_cache.h"
#include "mr/synth/synthetic_scene.h"
#include "mr/synth/view.h"

namespace mr::synth {
namespace {

/// Raise it when the same rig gives other pictures than before: old caches are left alone then.
constexpr std::uint64_t kPicturesVersion = 1;
constexpr std::uintmax_t kMostCacheBytes = std::uintmax_t{4} << 30;
constexpr auto kSweep = std::chrono::milliseconds(100);

/// Metres of a whole millimetre, as reading the picture from a file gives them.
const std::array<float, 65536>& metres_of() {
  static const auto table = [] {
    std::array<float, 65536> out{};
    for (std::size_t mm = 0; mm < out.size(); ++mm)
      out[mm] = static_cast<float>(static_cast<double>(mm) * 0.001);
    return out;
  }();
  return table;
}

/// What the sources of one rig share: the room and its people, made when they are first needed, and
/// the cache's remaining size.
struct Shared {
  Shared(const RigConfig& rig, double fps) : scene(rig, fps) {}

  SyntheticScene scene;
  std::atomic<std::int64_t> cache_budget{0};
};

/// A sensor between two pushes: how it stands, and what it sees from there.
struct SensorPlacement {
  std::uint32_t from = 0;  ///< frame of the rig
  ViewSetup setup;
  std::unique_ptr<ShotCache> cache;  ///< may be null
  std::unique_ptr<SensorView> view;  ///< made when a frame must be rendered
  std::optional<ImageRgb> color;     ///< of the empty room, once known
};

class RigSource final : public FrameSource {
 public:
  /// `standpoints`: by time, the first from frame 0.
  RigSource(std::shared_ptr<Shared> shared, const RigConfig& rig, const SensorConfig& sensor,
            SensorId sensor_id, double fps, std::vector<SensorPlacement> standpoints)
      : shared_(std::move(shared)),
        rig_(rig),
        sensor_(sensor),
        sensor_id_(sensor_id),
        fps_(fps),
        clock_error_s_(clock_error_s(rig, camera_of(sensor))),
        effects_(rig, camera_of(sensor), fps),
        standpoints_(std::move(standpoints)) {
    for (SensorPlacement& standpoint : standpoints_)
      if (standpoint.cache) standpoint.color = standpoint.cache->empty_room();
  }

  Result<std::optional<Frame>> next() override {
    const auto frames = static_cast<std::uint64_t>(rig_.frames);
    if (index_ >= frames && !rig_.loop) return std::optional<Frame>{};
    const auto shown = static_cast<std::uint32_t>(index_ % frames);
    Frame frame;
    frame.sensor = sensor_id_;
    frame.index = index_++;
    const double ns = static_cast<double>(frame.index) * 1e9 / fps_ + sensor_.clock_offset_ms * 1e6;
    frame.exposure_start = frame.exposure_end = TimePoint(Duration(std::llround(ns)));
    if (sensor_.depth_camera.model == CameraModel::lidar)
      frame.exposure_start -= kSweep / 2, frame.exposure_end += kSweep / 2;
    frame.T_world_depth = sensor_.T_world_depth.at(0);
    SensorPlacement& from = standpoint_at(shown);
    const auto known = from.cache && from.color ? from.cache->find(shown) : std::nullopt;
    if (known) {
      fill(frame, *from.color, *known);
    } else {
      const Shot shot = render(from, shown);
      fill(frame, *from.color, {shot.depth_mm, shot.spans, shot.rgb});
    }
    effects_.apply(frame.index, frame);
    return std::optional<Frame>(std::move(frame));
  }

  void skip(std::uint64_t frames) override { index_ += frames; }
  bool endless() const override { return rig_.loop; }

  /// How many of the rig's frames the cache holds.
  int kept() {
    int sum = 0;
    for (std::size_t i = 0; i < standpoints_.size(); ++i) {
      const SensorPlacement& from = standpoints_[i];
      const int end =
          i + 1 < standpoints_.size() ? static_cast<int>(standpoints_[i + 1].from) : rig_.frames;
      if (from.cache && from.color) sum += from.cache->count(static_cast<int>(from.from), end);
    }
    return sum;
  }

  /// Puts a frame of the rig into the cache where it is missing.
  void keep(std::uint32_t frame) {
    SensorPlacement& from = standpoint_at(frame);
    if (from.cache && !(from.color && from.cache->find(frame))) render(from, frame);
  }

 private:
  static std::uint32_t camera_of(const SensorConfig& sensor) {
    return sensor.source.get_if<SyntheticSource>()->camera;
  }

  SensorPlacement& standpoint_at(std::uint32_t frame) {
    std::size_t i = standpoints_.size() - 1;
    while (i > 0 && standpoints_[i].from > frame) --i;
    return standpoints_[i];
  }

  Shot render(SensorPlacement& from, std::uint32_t shown) {
    if (!from.view) {
      from.view = std::make_unique<SensorView>(shared_->scene.room(), from.setup);
      from.color = from.view->empty_room();
      if (from.cache) from.cache->begin(*from.color);
    }
    const double time_s = shown / fps_ + clock_error_s_;
    Shot shot = from.view->render(shared_->scene.people(time_s).get(), shown);
    if (from.cache) from.cache->add(shown, shot);
    return shot;
  }

  void fill(Frame& frame, const ImageRgb& empty_room, const ShotRef& shot) const {
    frame.depth = ImageDepth(sensor_.depth_camera.width, sensor_.depth_camera.height);
    const auto& metres = metres_of();
    for (std::size_t i = 0; i < shot.depth_mm.size(); ++i)
      frame.depth.data[i] = metres[shot.depth_mm[i]];
    frame.color = empty_room;
    const std::uint8_t* from = shot.rgb.data();
    for (const Shot::Span& span : shot.spans) {
      std::memcpy(frame.color.data.data() + 3 * std::size_t{span.first}, from,
                  3 * std::size_t{span.count});
      from += 3 * std::size_t{span.count};
    }
  }

  const std::shared_ptr<Shared> shared_;
  const RigConfig rig_;
  const SensorConfig sensor_;
  const SensorId sensor_id_;
  const double fps_;
  const double clock_error_s_;
  const SensorEffects effects_;
  std::vector<SensorPlacement> standpoints_;
  std::uint64_t index_ = 0;  // of the next frame
};

/// Adds anything to a hash, number by number.
class Hasher {
 public:
  void add(double v) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &v, sizeof bits);
    sum_ = mix(sum_, bits);
  }
  void add(const Pose& T) {
    for (const double v : T.matrix()) add(v);
  }
  void add(const Camera& c) {
    for (const double v : {static_cast<double>(c.model), 1.0 * c.width, 1.0 * c.height, c.fx, c.fy,
                           c.cx, c.cy, static_cast<double>(c.distortion)})
      add(v);
    for (const double v : c.k) add(v);
    for (const double v : c.p) add(v);
    for (const double v : c.beam_altitude_rad) add(v);
    for (const double v : c.beam_azimuth_rad) add(v);
  }
  std::uint64_t sum() const { return sum_; }

 private:
  std::uint64_t sum_ = mix(kPicturesVersion);
};

std::uint64_t sensor_key(std::uint64_t of_rig, const ViewSetup& setup) {
  Hasher hash;
  hash.add(setup.depth.camera);
  hash.add(setup.depth.T_world_camera);
  if (setup.color) {
    hash.add(setup.color->camera);
    hash.add(setup.color->T_world_camera);
  }
  for (const double v : {setup.noise.precision.base_m, setup.noise.precision.per_m2,
                         setup.noise.near_m, setup.noise.far_m})
    hash.add(v);
  return mix(of_rig, hash.sum());
}

/// What the pictures are made with: a true pose, not the one that the sensor states.
ViewSetup setup_of(const RigConfig& rig, const SensorConfig& sensor, const Pose& T_world_depth) {
  const auto camera = sensor.source.get_if<SyntheticSource>()->camera;
  ViewSetup setup;
  setup.depth = {sensor.depth_camera, T_world_depth};
  if (sensor.color_camera)
    setup.color = PosedCamera{*sensor.color_camera, T_world_depth * sensor.T_color_depth.inverse()};
  setup.noise = {rig.noise,          sensor.precision, sensor.depth_near_m,
                 sensor.depth_far_m, rig.depth_noise,  rig.depth_noise_px};
  setup.gain = exposure_gain(rig, camera);
  setup.seed = mix(rig.seed, camera);
  return setup;
}

/// Where a sensor truly stands, from the beginning and after every push.
std::vector<SensorPlacement> standpoints_of(const RigConfig& rig, const SensorConfig& sensor,
                                            const SensorConfig& exact) {
  std::vector<RigEvent> pushes;
  for (const RigEvent& event : rig.events)
    if (event.kind == RigEvent::Kind::push && event.sensor == exact.id) pushes.push_back(event);
  std::stable_sort(pushes.begin(), pushes.end(),
                   [](const RigEvent& a, const RigEvent& b) { return a.at < b.at; });
  Pose T_world_depth = exact.T_world_depth.at(0);
  std::vector<SensorPlacement> out;
  const auto add = [&](int from) {
    SensorPlacement standpoint;
    standpoint.from = static_cast<std::uint32_t>(from);
    standpoint.setup = setup_of(rig, sensor, T_world_depth);
    out.push_back(std::move(standpoint));
  };
  add(0);
  for (const RigEvent& push : pushes) {
    T_world_depth =
        T_world_depth * push_of(rig, push, sensor.source.get_if<SyntheticSource>()->camera);
    add(push.at);
  }
  return out;
}

std::string hex(std::uint64_t v) {
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(v));
  return text.data();
}

/// Makes the folder of a rig's cache; empty where there is none.
std::filesystem::path cache_folder(const RigCache& cache, std::uint64_t key) {
  if (cache.folder.empty()) return {};
  const std::filesystem::path folder = cache.folder / hex(key);
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) return {};
  trim_caches(cache.folder, folder, kMostCacheBytes / 2);
  return folder;
}

/// Renders what the cache lacks.
void render_ahead(const std::vector<RigSource*>& sources, int frames,
                  const std::function<void(int done, int of)>& progress) {
  const int of = frames * static_cast<int>(sources.size());
  int done = 0;
  for (RigSource* source : sources) done += source->kept();
  if (done == of) return;
  done = 0;
  for (int i = 0; i < frames; ++i) {
    progress(done, of);
    parallel_for(sources.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s) sources[s]->keep(static_cast<std::uint32_t>(i));
    });
    done += static_cast<int>(sources.size());
  }
  progress(of, of);
}

/// Noise beyond the usual and what happens; nothing of a rig without, whose key is as it ever was.
void add_disturbances(Hasher& hash, const RigConfig& rig) {
  const RigConfig usual;
  const auto add_unusual = [&](double purpose, double value, double default_value) {
    if (value != default_value) hash.add(purpose), hash.add(value);
  };
  add_unusual(1, rig.depth_noise, usual.depth_noise);
  add_unusual(2, rig.depth_noise_px, usual.depth_noise_px);
  add_unusual(3, rig.color_noise, usual.color_noise);
  add_unusual(4, rig.exposure_drift, usual.exposure_drift);
  add_unusual(5, rig.exposure_period_s, usual.exposure_period_s);
  add_unusual(7, rig.lidar_beams, usual.lidar_beams);
  add_unusual(8, rig.lidar_noise_mm, usual.lidar_noise_mm);
  for (const RigEvent& event : rig.events) {
    hash.add(6);
    for (const double v :
         {static_cast<double>(event.kind), 1.0 * event.at, 1.0 * event.frames,
          event.place_m ? event.place_m->x : 1e6, event.place_m ? event.place_m->y : 1e6,
          event.by_m, event.by_mm, event.by_deg, event.level, event.stops, event.period_s,
          1.0 * static_cast<double>(event.sensor.size())})
      hash.add(v);
    for (const char c : event.sensor) hash.add(static_cast<double>(c));
  }
}

}  // namespace

std::uint64_t rig_key(const RigConfig& rig, double fps) {
  Hasher hash;
  for (const double v : {static_cast<double>(rig.kind),
                         1.0 * rig.seed,
                         rig.room_m.x,
                         rig.room_m.y,
                         rig.room_m.z,
                         1.0 * rig.people,
                         1.0 * rig.sensors,
                         1.0 * rig.lidars,
                         1.0 * rig.depth_width,
                         1.0 * rig.depth_height,
                         1.0 * rig.color_width,
                         1.0 * rig.color_height,
                         1.0 * rig.noise,
                         rig.calib_error_mm,
                         rig.calib_error_deg,
                         rig.exposure_spread,
                         rig.clock_offset_ms,
                         rig.detail,
                         1.0 * rig.loop,
                         rig.loop ? 1.0 * rig.frames : 0.0,
                         fps})
    hash.add(v);
  add_disturbances(hash, rig);
  return hash.sum();
}

std::filesystem::path default_rig_cache() {
  const auto set = [](const char* name) {
    const char* value = std::getenv(name);
    return value != nullptr && value[0] == '/' ? std::filesystem::path(value)
                                               : std::filesystem::path();
  };
  if (const auto cache = set("XDG_CACHE_HOME"); !cache.empty()) return cache / "meshreduce/rigs";
  if (const auto home = set("HOME"); !home.empty()) return home / ".cache/meshreduce/rigs";
  return {};
}

std::vector<std::unique_ptr<FrameSource>> open_rig(const RigConfig& rig,
                                                   std::span<const SensorConfig> sensors,
                                                   std::span<const SensorId> wanted, double fps,
                                                   const RigCache& cache) {
  MR_ASSERT(fps > 0 && rig.frames > 0);
  const std::uint64_t key = rig_key(rig, fps);
  const std::filesystem::path folder = cache_folder(cache, key);
  const auto shared = std::make_shared<Shared>(rig, fps);
  shared->cache_budget = static_cast<std::int64_t>(kMostCacheBytes / 2) -
                         static_cast<std::int64_t>(folder.empty() ? 0 : folder_bytes(folder));
  const std::vector<SensorConfig> exact = exact_sensors(rig);
  std::vector<std::unique_ptr<FrameSource>> out;
  std::vector<RigSource*> sources;
  bool complete = true;
  for (const SensorId id : wanted) {
    const SensorConfig& sensor = sensors[index_of(id)];
    MR_ASSERT(sensor.source.get_if<SyntheticSource>() != nullptr);
    std::vector<SensorPlacement> standpoints =
        standpoints_of(rig, sensor, exact.at(sensor.source.get_if<SyntheticSource>()->camera));
    for (SensorPlacement& standpoint : standpoints) {
      if (folder.empty()) break;
      const Camera color = sensor.color_camera.value_or(Camera{});
      const ShotLayout layout{sensor_key(key, standpoint.setup), sensor.depth_camera.width,
                              sensor.depth_camera.height, color.width, color.height};
      standpoint.cache = std::make_unique<ShotCache>(
          folder / (sensor.id + "-" + hex(layout.key) + ".rig"), layout, shared->cache_budget);
    }
    auto source = std::make_unique<RigSource>(shared, rig, sensor, id, fps, std::move(standpoints));
    complete = complete && source->kept() == rig.frames;
    sources.push_back(source.get());
    out.push_back(std::move(source));
  }
  if (!complete) shared->scene.build();
  if (cache.progress && !folder.empty()) render_ahead(sources, rig.frames, cache.progress);
  return out;
}

}  // namespace mr::synth
