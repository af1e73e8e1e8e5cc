#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/temp_dir.h"
#include "mr/baseline/baseline.h"
#include "mr/core/parallel.h"
#include "mr/node/capture.h"
#include "mr/node/sources.h"

namespace mr::test {

/// Small pictures and coarse voxels: seconds, not minutes. Not prepared.
inline Scene small_scene(const std::string& pipeline, int sensors = 3) {
  Scene scene;
  scene.id = "small-room";
  scene.pipeline = pipeline;
  scene.voxel_m = 0.03, scene.fusion.truncation_m = 0.12;
  scene.simplify.ratio = 0.2;
  scene.rig = RigConfig{};
  scene.rig->sensors = sensors;
  scene.rig->depth_width = 320, scene.rig->depth_height = 288;
  scene.rig->color_width = 320, scene.rig->color_height = 180;
  MergerConfig root{.id = "root", .inputs = scene.rig->sensor_ids(), .deadline_ms = 50};
  scene.mergers = {root};
  return scene;
}

/// Rendered pictures are shared by the tests of a program.
inline const std::filesystem::path& rig_cache() {
  static const TempDir folder;
  return folder.path();
}

/// The first three captures of small_scene(); read once.
inline const std::vector<std::vector<Frame>>& first_captures(const Scene& scene) {
  static std::map<int, std::vector<std::vector<Frame>>> read;
  auto& captures = read[scene.rig->sensors];
  if (captures.empty()) {
    node::CaptureReader reader(scene, rig_cache());
    for (int i = 0; i < 3; ++i) captures.push_back(*reader.next());
  }
  return captures;
}

/// A prepared scene, its first captures and a system for it.
struct Rig {
  explicit Rig(const std::string& pipeline, int frames = 1, int sensors = 3)
      : Rig(small_scene(pipeline, sensors), frames) {}
  /// The scene's rig must be that of small_scene().
  Rig(Scene given, int frames) : scene(*node::prepare_scene(std::move(given))) {
    const auto& all = first_captures(scene);
    captures.assign(all.begin(), all.begin() + frames);
    system = fresh();
  }

  std::unique_ptr<baseline::Baseline> fresh() const { return *baseline::make_baseline(scene); }

  Scene scene;
  std::vector<std::vector<Frame>> captures;
  std::unique_ptr<baseline::Baseline> system;
};

/// The value of a result; the test fails where there is none.
template <typename T>
T value(Result<T> result) {
  EXPECT_TRUE(result) << result.error().message;
  return result ? *std::move(result) : T{};
}

}  // namespace mr::test
