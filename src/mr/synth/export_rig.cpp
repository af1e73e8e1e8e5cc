#include "mr/synth/export_rig.h"

#include <array>
#include <cstdarg>
#include <cstdio>
#include <memory>
#include <utility>
#include <vector>

#include "mr/core/file.h"
#include "mr/core/parallel.h"
#include "mr/synth/furniture.h"
#include "mr/synth/rig_errors.h"
#include "mr/synth/room.h"
#include "mr/synth/sensor_files.h"
#include "mr/synth/truth.h"
#include "mr/yaml/flow_text.h"

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

using yaml::camera_text;
using yaml::exact_text;
using yaml::list_text;

const char* depth_mode(const RigConfig& rig) {
  if (rig.depth_width == 1024) return "wfov";
  if (rig.depth_width == 512) return "wfov_binned";
  return rig.depth_width == 320 ? "nfov_binned" : "nfov";
}

const char* kind_name(RigConfig::Kind kind) {
  constexpr const char* kNames[] = {"room", "conference", "office", "corridor", "hallway"};
  return kNames[static_cast<int>(kind)];
}

using Format = RigExport::Format;

/// LiDARs have no format of a recording here.
Format format_of_sensor(const RigExport& what, const SensorConfig& sensor) {
  return sensor.depth_camera.model == CameraModel::pinhole ? what.format : Format::images;
}

/// The value of `source`.
std::string source_yaml(const SensorConfig& sensor, Format form, const RigConfig& rig) {
  const std::string loop = std::string(", loop: ") + (rig.loop ? "true}" : "false}");
  if (form == Format::mkv) return "{type: azure-kinect-mkv, file: " + sensor.id + ".mkv" + loop;
  if (form == Format::tum)
    return "{type: tum, folder: " + sensor.id + ", depth_unit_m: 0.0002" + (rig.loop ? loop : "}");
  const auto files = [&](const char* which) {
    return format("{pattern: \"%s/%s/%%06d.png\", first: 0, last: %d}", sensor.id.c_str(), which,
                  rig.frames - 1);
  };
  return "{type: rgbd-images, color: " + files("color") + ", depth: " + files("depth") +
         ", depth_unit_m: 0.001" + loop;
}

std::string sensor_yaml(const SensorConfig& sensor, Format form, const RigConfig& rig) {
  std::string out = "  - id: " + sensor.id + "\n    source: " + source_yaml(sensor, form, rig);
  if (form != Format::mkv)  // whose recording has them
    out += "\n    depth_camera: " + camera_text(sensor.depth_camera) +
           "\n    color_camera: " + camera_text(*sensor.color_camera) +
           "\n    T_color_depth: " + list_text(sensor.T_color_depth.matrix());
  out += "\n    T_world_depth: ";
  out += form == Format::tum ? "{trajectory: " + sensor.id + "/groundtruth.txt}"
                             : list_text(sensor.T_world_depth.at(0).matrix());
  return out + "\n    depth_range_m: [" + exact_text(sensor.depth_near_m) + ", " +
         exact_text(sensor.depth_far_m) +
         "]\n    precision: {base_m: " + exact_text(sensor.precision.base_m) +
         ", per_m2: " + exact_text(sensor.precision.per_m2) + "}\n";
}

std::string scene_yaml(const RigExport& what, std::span<const SensorConfig> sensors) {
  std::string out =
      "# Written by `meshreduce synth`; `truth` is the noiseless surface.\nscene: synthetic-";
  out += kind_name(what.rig.kind);
  out += "\nup: [0, 0, 1]\nfps: " + exact_text(what.fps) +
         "\nvoxel_m: 0.02\nsimplify: {ratio: 0.1}\nsensors:\n";
  for (const SensorConfig& sensor : sensors)
    out += sensor_yaml(sensor, format_of_sensor(what, sensor), what.rig);
  return out + "truth: {mesh: \"truth/%06d.ply\", rig: " + rig_yaml(what.rig) + "}\n";
}

/// Kinect `i` of the rig: the first leads the others, whose exposures follow 160 us apart, so that
/// their infrared light does not disturb; each recording begins at another time.
MkvDevice device_of(const RigExport& what, const SensorConfig& stated, const SensorConfig& exact,
                    int i) {
  MkvDevice device;
  device.depth_camera = stated.depth_camera, device.color_camera = *stated.color_camera;
  device.T_color_depth = stated.T_color_depth;
  device.up_depth =
      transposed(exact.T_world_depth.at(0).rotation) * (room_pose().rotation * Vec3d{0, 0, 1});
  device.fps = what.fps;
  device.serial = format("%06u%06d", what.rig.seed % 1'000'000, i + 1);
  if (what.rig.sensors > 1)
    device.sync = i == 0 ? MkvDevice::Sync::master : MkvDevice::Sync::subordinate;
  device.subordinate_delay = std::chrono::microseconds(160 * i);
  device.start_offset =
      device.epoch + device.subordinate_delay - std::chrono::milliseconds(20 + 7 * (i % 20));
  device.color = what.mkv_color;
  return device;
}

using AllFiles = std::vector<std::unique_ptr<SensorFiles>>;

Result<AllFiles> open_files(const RigExport& what, std::span<const SensorConfig> sensors) {
  const std::vector<SensorConfig> exact = exact_sensors(what.rig);
  AllFiles files;
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const SensorConfig& sensor = sensors[i];
    const Format form = format_of_sensor(what, sensor);
    const std::filesystem::path folder = what.folder / sensor.id;
    auto opened = form == Format::images ? open_picture_files(folder)
                  : form == Format::tum
                      ? open_tum_folder(folder, sensor.T_world_depth.at(0), what.fps)
                      : open_mkv_file(folder.string() + ".mkv",
                                      device_of(what, sensor, exact[i], static_cast<int>(i)));
    if (!opened) return opened.error();
    files.push_back(std::move(*opened));
  }
  return files;
}

Status write_next_frame(FrameSource& source, SensorFiles& files) {
  const auto frame = source.next();
  if (!frame) return frame.error();
  MR_ASSERT(frame->has_value());
  return files.write(**frame);
}

/// The keys that count for an event's kind.
std::string event_yaml(const RigEvent& event) {
  using Kind = RigEvent::Kind;
  const Kind kind = event.kind;
  std::string out = format("{kind: %s, at: %d", name_of(kind), event.at);
  if (kind != Kind::carry && kind != Kind::push) out += format(", frames: %d", event.frames);
  if (!event.sensor.empty()) out += ", sensor: " + event.sensor;
  if (event.place_m) out += format(", place: [%.9g, %.9g]", event.place_m->x, event.place_m->y);
  if (kind == Kind::chair) out += ", by_m: " + exact_text(event.by_m);
  if (kind == Kind::light) out += ", level: " + exact_text(event.level);
  if (kind == Kind::push)
    out += ", by_mm: " + exact_text(event.by_mm) + ", by_deg: " + exact_text(event.by_deg);
  if (kind == Kind::exposure || kind == Kind::hunt) out += ", stops: " + exact_text(event.stops);
  if (kind == Kind::hunt) out += ", period_s: " + exact_text(event.period_s);
  return out + "}";
}

/// What is not as in a usual rig; begins with a comma.
std::string disturbances_yaml(const RigConfig& rig) {
  const RigConfig usual;
  std::string out;
  const auto add = [&](const char* key, double value, double default_value) {
    if (value != default_value) out += std::string(", ") + key + ": " + exact_text(value);
  };
  add("depth_noise", rig.depth_noise, usual.depth_noise);
  add("depth_noise_px", rig.depth_noise_px, usual.depth_noise_px);
  add("color_noise", rig.color_noise, usual.color_noise);
  add("exposure_drift", rig.exposure_drift, usual.exposure_drift);
  add("exposure_period_s", rig.exposure_period_s, usual.exposure_period_s);
  add("lidar_beams", rig.lidar_beams, usual.lidar_beams);
  add("lidar_noise_mm", rig.lidar_noise_mm, usual.lidar_noise_mm);
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
  for (const SensorConfig& sensor : sensors)
    if (format_of_sensor(what, sensor) == Format::mkv)
      if (const Status can = check_recordable(sensor.depth_camera, *sensor.color_camera, what.fps);
          !can)
        return can;
  if (const Status made = make_folder(what.folder / "truth"); !made) return made;
  auto files = open_files(what, sensors);
  if (!files) return files.error();
  const std::vector<SensorId> all = all_sensors(sensors);
  const auto sources = open_rig(what.rig, sensors, all, what.fps, {});
  Truth truth(what.rig, what.fps);
  for (int frame = 0; frame < what.rig.frames; ++frame) {
    if (what.progress) what.progress(frame, what.rig.frames);
    std::vector<Status> written(sensors.size());
    parallel_for(sensors.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        written[i] = write_next_frame(*sources[i], *(*files)[i]);
    });
    written.push_back(write_ply(what.folder / "truth" / format("%06d.ply", frame),
                                truth.surface(static_cast<std::uint64_t>(frame))));
    for (const Status& status : written)
      if (!status) return status;
  }
  for (const auto& file : *files)
    if (const Status closed = file->close(); !closed) return closed;
  return write_file(what.folder / "scene.yaml", scene_yaml(what, sensors));
}

}  // namespace mr::synth
