#pragma once

#include <gtest/gtest.h>

#include <initializer_list>
#include <string>
#include <vector>

#include "core/temp_dir.h"
#include "mr/scene/scene.h"

namespace mr::test {

inline constexpr const char* kIdentity = "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]";

/// One sensor on one line, with depth only.
inline std::string sensor(const std::string& id) {
  return "  - {id: " + id + ", source: {type: rgbd-images, depth: d.png}, " +
         "depth_camera: {size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}, T_world_depth: " +
         kIdentity + "}\n";
}

inline std::string scene_of(std::initializer_list<const char*> ids, const std::string& rest = "") {
  std::string text = "scene: s\nsensors:\n";
  for (const char* id : ids) text += sensor(id);
  return text + rest;
}

/// A sensor over several lines; `source` and `poses` are what stands behind those keys.
inline std::string long_sensor(const std::string& source, const std::string& poses = kIdentity,
                               const std::string& more = "") {
  return "scene: s\nsensors:\n  - id: a\n    source: " + source +
         "\n    depth_camera: {model: pinhole, size: [640, 480], fx: 585, fy: 585, cx: 320, cy: "
         "240}"
         "\n    T_world_depth: " +
         poses + "\n" + more;
}

class SceneFile : public testing::Test {
 protected:
  SceneFile() { dir_.write("d.png", "x"); }

  SceneResult load(const std::string& text) { return load_scene(dir_.write("scene.yaml", text)); }

  /// "line: message" of each problem.
  std::vector<std::string> problems(const std::string& text) {
    return shorten(load(text).problems);
  }
  std::vector<std::string> notices(const std::string& text) { return shorten(load(text).notices); }

  static std::vector<std::string> shorten(const std::vector<SceneProblem>& list) {
    std::vector<std::string> out;
    for (const SceneProblem& p : list) out.push_back(std::to_string(p.line) + ": " + p.message);
    return out;
  }

  /// The one problem that a line of a small scene makes.
  std::string problem_of(const std::string& line) {
    const auto found = problems(scene_of({"a"}, line + "\n"));
    if (found.size() != 1) return "not one problem but " + testing::PrintToString(found);
    return found[0];
  }

  TempDir dir_;
};

}  // namespace mr::test
