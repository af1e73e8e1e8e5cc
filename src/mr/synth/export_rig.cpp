#include "mr/synth/export_rig.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <numbers>
#include <numeric>
#include <vector>

#include "mr/core/file.h"
#include "mr/core/parallel.h"
#include "mr/kit/image_io.h"
#include "mr/synth/depth_png.h"
#include "mr/synth/room.h"
#include "mr/synth/truth.h"

namespace mr::synth {
namespace {

/// printf into a string.
[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  std::array<char, 512> text{};
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text.data(), text.size(), pattern, arguments);
  va_end(arguments);
  return text.data();
}

/// The shortest text that reads back as the same number.
std::string number(double v) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), v).ptr};
}

std::string list(std::span<const double> values) {
  std::string out;
  for (const double v : values) out += (out.empty() ? "[" : ", ") + number(v);
  return out + "]";
}

const char* depth_mode(const RigConfig& rig) {
  if (rig.depth_width == 1024) return "wfov";
  if (rig.depth_width == 512) return "wfov_binned";
  return rig.depth_width == 320 ? "nfov_binned" : "nfov";
}

const char* kind_name(RigConfig::Kind kind) {
  constexpr const char* kNames[] = {"room", "conference", "office", "corridor", "hallway"};
  return kNames[static_cast<int>(kind)];
}

std::string camera_yaml(const Camera& camera) {
  const std::string size = format("size: [%d, %d]", camera.width, camera.height);
  if (camera.model == CameraModel::equirectangular) return "{model: equirectangular, " + size + "}";
  if (camera.model == CameraModel::lidar) {
    std::vector<double> degrees;
    for (const double angle : camera.beam_altitude_rad)
      degrees.push_back(angle * 180 / std::numbers::pi);
    return "{model: lidar, " + size + ", beam_altitude_deg: " + list(degrees) + "}";
  }
  return "{model: pinhole, " + size + ", fx: " + number(camera.fx) + ", fy: " + number(camera.fy) +
         ", cx: " + number(camera.cx) + ", cy: " + number(camera.cy) + "}";
}

std::string sensor_yaml(const SensorConfig& sensor, const RigConfig& rig) {
  const auto files = [&](const char* which) {
    return format("{pattern: \"%s/%s/%%06d.png\", first: 0, last: %d}", sensor.id.c_str(), which,
                  rig.frames - 1);
  };
  return "  - id: " + sensor.id + "\n    source: {type: rgbd-images, color: " + files("color") +
         ", depth: " + files("depth") +
         ", depth_unit_m: 0.001, loop: " + (rig.loop ? "true" : "false") +
         "}\n    depth_camera: " + camera_yaml(sensor.depth_camera) +
         "\n    color_camera: " + camera_yaml(*sensor.color_camera) +
         "\n    T_color_depth: " + list(sensor.T_color_depth.matrix()) +
         "\n    T_world_depth: " + list(sensor.T_world_depth.at(0).matrix()) +
         "\n    depth_range_m: [" + number(sensor.depth_near_m) + ", " +
         number(sensor.depth_far_m) +
         "]\n    precision: {base_m: " + number(sensor.precision.base_m) +
         ", per_m2: " + number(sensor.precision.per_m2) + "}\n";
}

std::string scene_yaml(const RigExport& what, std::span<const SensorConfig> sensors) {
  std::string out =
      "# Written by `meshreduce synth`; `truth` is the noiseless surface.\nscene: synthetic-";
  out += kind_name(what.rig.kind);
  out += "\nup: [0, 0, 1]\nfps: " + number(what.fps) +
         "\nvoxel_m: 0.02\nsimplify: {ratio: 0.1}\nsensors:\n";
  for (const SensorConfig& sensor : sensors) out += sensor_yaml(sensor, what.rig);
  return out + "truth: {mesh: \"truth/%06d.ply\", rig: " + rig_yaml(what.rig) + "}\n";
}

std::filesystem::path numbered(const std::filesystem::path& folder, int frame, const char* ending) {
  return folder / format("%06d%s", frame, ending);
}

/// Writes a sensor's next frame.
Status write_frame(FrameSource& source, const std::filesystem::path& folder, int number) {
  const auto frame = source.next();
  if (!frame) return frame.error();
  MR_ASSERT(frame->has_value());
  const ImageDepth& depth = (*frame)->depth;
  std::vector<std::uint16_t> counts(depth.data.size());
  for (std::size_t i = 0; i < counts.size(); ++i)
    counts[i] = static_cast<std::uint16_t>(std::lround(depth.data[i] * 1000));
  if (const Status ok = write_depth_png(numbered(folder / "depth", number, ".png"), depth.width,
                                        depth.height, counts);
      !ok)
    return ok;
  return kit::write_png(numbered(folder / "color", number, ".png"), (*frame)->color);
}

Status make_folders(const RigExport& what, std::span<const SensorConfig> sensors) {
  std::vector<std::filesystem::path> folders{what.folder / "truth"};
  for (const SensorConfig& sensor : sensors)
    for (const char* kind : {"color", "depth"}) folders.push_back(what.folder / sensor.id / kind);
  for (const auto& folder : folders) {
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed)
      return Error{Error::Cause::io,
                   "cannot make folder " + folder.string() + ": " + failed.message()};
  }
  return {};
}

/// The keys that count for an event's kind.
std::string event_yaml(const RigEvent& event) {
  using Kind = RigEvent::Kind;
  const Kind kind = event.kind;
  std::string out = format("{kind: %s, at: %d", name_of(kind), event.at);
  if (kind != Kind::carry && kind != Kind::push) out += format(", frames: %d", event.frames);
  if (!event.sensor.empty()) out += ", sensor: " + event.sensor;
  if (event.place_m) out += format(", place: [%.9g, %.9g]", event.place_m->x, event.place_m->y);
  if (kind == Kind::chair) out += ", by_m: " + number(event.by_m);
  if (kind == Kind::light) out += ", level: " + number(event.level);
  if (kind == Kind::push)
    out += ", by_mm: " + number(event.by_mm) + ", by_deg: " + number(event.by_deg);
  if (kind == Kind::exposure || kind == Kind::hunt) out += ", stops: " + number(event.stops);
  if (kind == Kind::hunt) out += ", period_s: " + number(event.period_s);
  return out + "}";
}

/// What is not as in a usual rig; begins with a comma.
std::string disturbances_yaml(const RigConfig& rig) {
  const RigConfig usual;
  std::string out;
  const auto add = [&](const char* key, double value, double default_value) {
    if (value != default_value) out += std::string(", ") + key + ": " + number(value);
  };
  add("depth_noise", rig.depth_noise, usual.depth_noise);
  add("depth_noise_px", rig.depth_noise_px, usual.depth_noise_px);
  add("color_noise", rig.color_noise, usual.color_noise);
  add("exposure_drift", rig.exposure_drift, usual.exposure_drift);
  add("exposure_period_s", rig.exposure_period_s, usual.exposure_period_s);
  std::string events;
  for (const RigEvent& event : rig.events)
    events += (events.empty() ? "" : ", ") + event_yaml(event);
  return events.empty() ? out : out + ", events: [" + events + "]";
}

}  // namespace

std::string rig_yaml(const RigConfig& rig) {
  return format(
             "{type: synthetic, kind: %s, seed: %u, room: [%.9g, %.9g, %.9g], people: %d, sensors: "
             "%d, "
             "lidars: %d, depth_mode: %s, color: [%d, %d], ",
             kind_name(rig.kind), rig.seed, rig.room_m.x, rig.room_m.y, rig.room_m.z, rig.people,
             rig.sensors, rig.lidars, depth_mode(rig), rig.color_width, rig.color_height) +
         format(
             "noise: %s, calib_error_mm: %.9g, calib_error_deg: %.9g, exposure_spread: %.9g, "
             "clock_offset_ms: %.9g, detail: %.9g, frames: %d, loop: %s",
             rig.noise ? "kinect" : "none", rig.calib_error_mm, rig.calib_error_deg,
             rig.exposure_spread, rig.clock_offset_ms, rig.detail, rig.frames,
             rig.loop ? "true" : "false") +
         disturbances_yaml(rig) + "}";
}

Status export_rig(const RigExport& what) {
  const std::vector<SensorConfig> sensors = rig_sensors(what.rig);
  if (const Status made = make_folders(what, sensors); !made) return made;
  const std::vector<SensorId> all = all_sensors(sensors);
  const auto sources = open_rig(what.rig, sensors, all, what.fps, {});
  Truth truth(what.rig, what.fps);
  for (int frame = 0; frame < what.rig.frames; ++frame) {
    if (what.progress) what.progress(frame, what.rig.frames);
    std::vector<Status> written(sensors.size());
    parallel_for(sensors.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        written[i] = write_frame(*sources[i], what.folder / sensors[i].id, frame);
    });
    written.push_back(write_ply(numbered(what.folder / "truth", frame, ".ply"),
                                truth.surface(static_cast<std::uint64_t>(frame))));
    for (const Status& status : written)
      if (!status) return status;
  }
  return write_file(what.folder / "scene.yaml", scene_yaml(what, sensors));
}

}  // namespace mr::synth
