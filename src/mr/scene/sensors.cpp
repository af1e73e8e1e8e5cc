#include "mr/scene/parts.h"
#include "mr/sensor/source_registry.h"
#include "mr/sensor/timelines.h"

namespace mr::scene_file {
namespace {

constexpr std::size_t kMaxSensors = 1024;

void read_distortion(Report& report, const yaml::Node& node, Camera& camera) {
  MapReader map(report, node, "distortion");
  const bool known = map.need("model") &&
                     map.choice<DistortionModel>("model", camera.distortion,
                                                 {{"none", DistortionModel::none},
                                                  {"brown", DistortionModel::brown},
                                                  {"rational", DistortionModel::rational},
                                                  {"rational_6kt", DistortionModel::rational_6kt}});
  if (const yaml::Node* k = map.find("k")) {
    const std::size_t most = !known || camera.distortion >= DistortionModel::rational ? 6 : 3;
    if (k->kind == yaml::Node::Kind::list && k->items.size() >= 1 && k->items.size() <= most)
      yaml::read_numbers(report, *k, "k", {-1e6, 1e6}, std::span(camera.k).first(k->items.size()));
    else
      report.problem(k->line, "k must be a list of 1 to " + std::to_string(most) + " numbers");
  }
  map.numbers("p", {-1e6, 1e6}, camera.p);
  map.number("most_radius", camera.most_radius, {0, 1e6});
  if (known && camera.distortion == DistortionModel::none)
    for (const char* key : {"k", "p", "most_radius"})
      if (map.has(key)) map.not_acted_on(key, std::string(key) + " of distortion none");
}

/// A LiDAR's beams, one a row: [altitudes] or {from, to}, evenly spread; offsets of their azimuths
/// may be left out. False where a problem was reported.
bool read_beams(MapReader& map, Camera& camera) {
  constexpr double kRadians = std::numbers::pi / 180;
  const yaml::Node* node = map.need("beam_altitude_deg");
  if (!node) return false;
  std::vector<double> degrees(camera.height);
  if (node->kind == yaml::Node::Kind::map) {
    MapReader range(map.report, *node, "beam_altitude_deg");
    double from = 0, to = 0;
    if (!range.need("from") || !range.need("to") || !range.number("from", from, {-90, 90}) ||
        !range.number("to", to, {-90, 90}))
      return false;
    for (int row = 0; row < camera.height; ++row)
      degrees[row] = from + (to - from) * row / std::max(1, camera.height - 1);
  } else if (!yaml::read_numbers(map.report, *node, "beam_altitude_deg", {-90, 90}, degrees)) {
    return false;
  }
  for (const double angle : degrees) camera.beam_altitude_rad.push_back(angle * kRadians);
  std::vector<double> azimuths(camera.height);
  if (map.has("beam_azimuth_deg") && !map.numbers("beam_azimuth_deg", {-360, 360}, azimuths))
    return false;
  for (const double angle : azimuths) camera.beam_azimuth_rad.push_back(angle * kRadians);
  return true;
}

/// The line to report for a problem of Camera::problems(), which names no key.
int line_of_problem(const MapReader& map, const Camera& camera, const std::string& problem) {
  if (problem.starts_with("size")) return map.line("size");
  if (problem.starts_with("focal")) return map.line("fx");
  if (problem.starts_with("distortion")) return map.line("distortion");
  if (problem.starts_with("principal"))
    return map.line(camera.cx < 0 || camera.cx > camera.width - 1 ? "cx" : "cy");
  return map.line();
}

std::string supported_types() {
  std::string out;
  for (const sensor::SourceType& type : sensor::source_types())
    out += (out.empty() ? "" : ", ") + std::string(type.name);
  return out;
}

/// What its keys say; nothing: unknown.
std::optional<sensor::SourceKeys> read_source(Report& report, const yaml::Node& node,
                                              SensorConfig& sensor) {
  MapReader map(report, node, "source");
  std::string name;
  const bool named = map.need("type") && map.text("type", name);
  const sensor::SourceType* type = sensor::find_source_type(name);
  if (!named || !type) {
    map.accept_all();  // the other keys belong to a type that is not known here
    if (named)
      report.problem(map.line("type"),
                     "source type " + in_quotes(name) +
                         " is not supported by this version; supported: " + supported_types());
    return std::nullopt;
  }
  sensor::SourceKeys keys = type->read(map, "sensors." + sensor.id + ".source");
  sensor.source = keys.config;
  return keys;
}

/// What the source tells of its cameras, where the scene's keys do not say otherwise.
void take_cameras(const sensor::SourceCameras& cameras, SensorConfig& sensor) {
  sensor.depth_camera = cameras.depth;
  sensor.color_camera = cameras.color;
  sensor.T_color_depth = cameras.T_color_depth;
  sensor.depth_near_m = cameras.depth_near_m, sensor.depth_far_m = cameras.depth_far_m;
  sensor.precision = cameras.precision;
}

/// `keys`: of the source; nothing where it could not be read.
void read_cameras(MapReader& map, SensorConfig& sensor,
                  const std::optional<sensor::SourceKeys>& keys) {
  Report& report = map.report;
  const bool is_told = keys && keys->cameras;
  if (keys && !keys->no_camera.empty() && !map.has(is_told ? "color_camera" : "depth_camera")) {
    report.problem(map.line("source"), keys->no_camera + "; or state " +
                                           (is_told ? "color_camera" : "depth_camera") +
                                           " in the scene");
    return;
  }
  if (const yaml::Node* node = is_told ? map.find("depth_camera") : map.need("depth_camera")) {
    const auto camera = read_camera(report, *node, "depth_camera");
    if (camera && camera->model == CameraModel::equirectangular)
      report.problem(
          node->line,
          "depth_camera: only the models pinhole and lidar are supported by this version");
    if (camera) sensor.depth_camera = *camera;
  }
  const yaml::Node* color = map.find("color_camera");
  if (color) sensor.color_camera = read_camera(report, *color, "color_camera");
  if (sensor.color_camera && sensor.color_camera->model == CameraModel::lidar)
    report.problem(color->line, "color_camera: a lidar takes no colour pictures");
  if (keys && !is_told && keys->has_color != (color != nullptr))
    report.problem(color ? map.line("color_camera") : map.line("source"),
                   color ? "color_camera is given but source names no color"
                         : "source names color but color_camera is missing");
  if (const yaml::Node* node = map.find("T_color_depth"))
    if (const auto pose = read_pose(report, *node, "T_color_depth")) sensor.T_color_depth = *pose;
  if (keys) sensor.T_color_depth = keys->T_picture_color * sensor.T_color_depth;
}

void read_depth_figures(MapReader& map, SensorConfig& sensor) {
  double range[2];
  if (map.numbers("depth_range_m", SensorConfig::kDepth_m, range)) {
    if (range[0] < range[1])
      sensor.depth_near_m = range[0], sensor.depth_far_m = range[1];
    else
      map.report.problem(map.line("depth_range_m"),
                         "depth_range_m must be [near, far] with near less than far");
  }
  if (const yaml::Node* node = map.find("precision")) {
    MapReader precision(map.report, *node, "precision");
    precision.number("base_m", sensor.precision.base_m, Precision::kBase_m);
    precision.number("per_m2", sensor.precision.per_m2, Precision::kPer_m2);
  }
  map.number("clock_offset_ms", sensor.clock_offset_ms, SensorConfig::kClockOffset_ms);
  map.number("clock_drift_ppm", sensor.clock_drift_ppm, SensorConfig::kClockDrift_ppm);
}

SensorConfig read_sensor(Report& report, const yaml::Node& node, std::vector<NodeName>& names) {
  SensorConfig sensor;
  MapReader map(report, node, "sensor");
  if (const yaml::Node* id = map.need("id"))
    if (const auto text = yaml::read_id(report, *id, "id")) {
      sensor.id = *text;
      names.push_back({*text, id->line});
    }
  std::optional<sensor::SourceKeys> keys;
  if (const yaml::Node* source = map.need("source")) keys = read_source(report, *source, sensor);
  if (keys && keys->cameras) take_cameras(*keys->cameras, sensor);
  read_cameras(map, sensor, keys);
  map.flag("moving", sensor.moving);
  if (const yaml::Node* poses = map.need("T_world_depth"))
    read_poses(report, *poses, "T_world_depth", sensor);
  const std::size_t items = sensor.source.content().items, poses = sensor.T_world_depth.size();
  if (items > 0 && poses > 1 && poses != items && sensor.trajectory.poses().empty())
    report.problem(map.line("T_world_depth"), "T_world_depth holds " + std::to_string(poses) +
                                                  " poses for " + std::to_string(items) +
                                                  " items; it needs one, or one per item");
  read_depth_figures(map, sensor);
  return sensor;
}

}  // namespace

std::optional<Camera> read_camera(Report& report, const yaml::Node& node, const std::string& name) {
  constexpr double kMost = 1e6;
  Camera camera;
  MapReader map(report, node, name);
  bool good = !map.has("model") ||
              map.choice<CameraModel>("model", camera.model,
                                      {{"pinhole", CameraModel::pinhole},
                                       {"equirectangular", CameraModel::equirectangular},
                                       {"lidar", CameraModel::lidar}});
  const bool pinhole = camera.model == CameraModel::pinhole;
  good &= map.need("size") && map.size("size", {1, 16384}, camera.width, camera.height);
  const auto intrinsic = [&](const char* key, double& out, Range range) {
    if (pinhole && !map.need(key)) return false;
    return map.number(key, out, range) || !pinhole;
  };
  good &= intrinsic("fx", camera.fx, {0, kMost, true});
  good &= intrinsic("fy", camera.fy, {0, kMost, true});
  good &= intrinsic("cx", camera.cx, {-kMost, kMost});
  good &= intrinsic("cy", camera.cy, {-kMost, kMost});
  if (const yaml::Node* distortion = map.find("distortion"))
    read_distortion(report, *distortion, camera);
  if (camera.model == CameraModel::lidar) {
    const bool has_beams = map.has("beam_altitude_deg") | map.has("beam_azimuth_deg");
    good = good && read_beams(map, camera) && has_beams;
  }
  if (!good) return std::nullopt;
  if (!pinhole)
    for (const char* key : {"fx", "fy", "cx", "cy", "distortion"})
      if (map.has(key)) map.not_acted_on(key, std::string(key) + " of a camera that is no pinhole");
  for (const std::string& problem : camera.problems())
    report.problem(line_of_problem(map, camera, problem), name + ": " + problem);
  return camera;
}

std::vector<SensorConfig> read_sensors(Report& report, const yaml::Node& node,
                                       std::vector<NodeName>& names) {
  std::vector<SensorConfig> sensors;
  if (node.kind != yaml::Node::Kind::list || node.items.empty() ||
      node.items.size() > kMaxSensors) {
    report.problem(node.line,
                   "sensors must be a list of 1 to " + std::to_string(kMaxSensors) + " sensors");
    return sensors;
  }
  for (const yaml::Node& item : node.items) sensors.push_back(read_sensor(report, item, names));
  for (std::string& note : sensor::timeline_notes(sensors))
    report.notice(node.line, std::move(note));
  return sensors;
}

}  // namespace mr::scene_file
