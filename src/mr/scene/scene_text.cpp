#include "mr/scene/scene_text.h"
#include "mr/core/user_text.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "mr/core/assert.h"
#include "mr/yaml/flow_text.h"
#include "mr/yaml/tree.h"

namespace mr {
namespace {

constexpr int kIndent = 6;  // of lines that go on, within a sensor

/// A path as the scene file has it.
std::string near_path(const std::filesystem::path& path, const std::filesystem::path& folder) {
  constexpr int kMostUp = 2;
  const std::filesystem::path relative = path.lexically_relative(folder);
  const auto up = std::count(relative.begin(), relative.end(), "..");
  return relative.empty() || up > kMostUp ? path.string() : relative.generic_string();
}

/// "    key: value", wrapped, with paths as the scene file has them.
std::string key_text(const std::string& key, const std::string& value,
                     const std::filesystem::path& folder) {
  const std::string start = "    " + key + ": ";
  const yaml::Tree tree = yaml::parse_yaml(value);
  if (!tree.problem.empty()) return start + value + "\n";  // loading the file tells
  const auto to_near = [&](yaml::Node& scalar) {
    if (scalar.text.starts_with('/')) scalar.text = near_path(scalar.text, folder);
  };
  return start + yaml::flow_text(tree.root, static_cast<int>(start.size()), kIndent, to_near) +
         "\n";
}

std::string comment_text(const std::vector<std::string>& lines, const std::string& indent) {
  std::string out;
  for (const std::string& line : lines) out += indent + "# " + one_line(line) + "\n";
  return out;
}

std::string depth_figures(const sensor::ImportedSensor& sensor) {
  std::string out;
  if (sensor.depth_near_m && sensor.depth_far_m)
    out += "    depth_range_m: " +
           yaml::list_text(std::array{*sensor.depth_near_m, *sensor.depth_far_m}) + "\n";
  if (sensor.precision)
    out += "    precision: {base_m: " + yaml::exact_text(sensor.precision->base_m) +
           ", per_m2: " + yaml::exact_text(sensor.precision->per_m2) + "}\n";
  return out;
}

std::string sensor_text(const sensor::ImportedSensor& sensor, const std::filesystem::path& folder) {
  std::string out = comment_text(sensor.comments, "  ") + "  - id: " + sensor.id + "\n" +
                    key_text("source", sensor.source, folder);
  if (sensor.depth_camera)
    out += key_text("depth_camera", yaml::camera_text(*sensor.depth_camera), folder);
  if (sensor.color_camera)
    out += key_text("color_camera", yaml::camera_text(*sensor.color_camera), folder);
  if (sensor.T_color_depth)
    out += key_text("T_color_depth", yaml::list_text(sensor.T_color_depth->matrix()), folder);
  if (sensor.T_world_depth.empty())
    out +=
        "    # Not known: the identity. Of several sensors each needs its own, camera to world.\n";
  out += key_text(
      "T_world_depth",
      sensor.T_world_depth.empty() ? yaml::list_text(Pose{}.matrix()) : sensor.T_world_depth,
      folder);
  return out + depth_figures(sensor);
}

}  // namespace

std::string scene_text(const sensor::ImportedScene& scene, const std::filesystem::path& folder) {
  std::string out =
      "# Written by `meshreduce import`. Metres; camera axes: x right, y down, z forward. Every "
      "key "
      "is\n# explained in docs/scene-file.md; `meshreduce info FILE` checks the file and its first "
      "pictures.\n" +
      comment_text(scene.notes, "") + "scene: " + scene.name + "\n";
  if (scene.up)
    out += "up: " + yaml::list_text(std::array{scene.up->x, scene.up->y, scene.up->z}) + "\n";
  else
    out += "# up: [0, -1, 0]    # the world's direction that points up; not known\n";
  out += "fps: " + yaml::exact_text(scene.fps) + "\nvoxel_m: " + yaml::exact_text(scene.voxel_m) +
         "\nsimplify: {ratio: 0.1}\n\n"
         "sensors:\n";
  for (const sensor::ImportedSensor& sensor : scene.sensors) out += sensor_text(sensor, folder);
  return out;
}

sensor::ImportedScene one_scene(std::vector<sensor::ImportedScene> scenes) {
  MR_ASSERT(!scenes.empty());
  sensor::ImportedScene out;
  out.name = scenes.front().name;
  out.fps = scenes.front().fps;
  std::set<std::string> ids;
  for (sensor::ImportedScene& scene : scenes) {
    out.fps = std::max(out.fps, scene.fps);
    if (!out.up) out.up = scene.up;
    out.voxel_m = std::max(out.voxel_m, scene.voxel_m);
    for (std::string& note : scene.notes)
      if (std::ranges::find(out.notes, note) == out.notes.end()) out.notes.push_back(note);
    for (sensor::ImportedSensor& sensor : scene.sensors) {
      const std::string id = sensor.id.substr(0, 58);
      for (int number = 2; !ids.insert(sensor.id).second; ++number)
        sensor.id = id + "-" + std::to_string(number);
      out.sensors.push_back(std::move(sensor));
    }
  }
  const auto unplaced = std::ranges::count_if(
      out.sensors, [](const auto& sensor) { return sensor.T_world_depth.empty(); });
  if (unplaced > 1)
    out.notes.push_back(std::to_string(unplaced) +
                        " sensors have no pose and stand at one place: give each its "
                        "T_world_depth, or they will be a jumble");
  return out;
}

}  // namespace mr
