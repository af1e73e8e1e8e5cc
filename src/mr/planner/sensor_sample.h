#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/pose.h"
#include "mr/core/vec.h"
#include "mr/scene/scene.h"

namespace mr::planner {

/// What is known about a sensor before the scene runs.
struct SensorSample {
  double triangles = 10'000;   ///< that it sends each frame
  double area_m2 = 0;          ///< of its surface; 0: follows from the triangles
  double reconstruct_ms = 0;   ///< of its depth, on this machine; 0: not known
  std::vector<Vec3f> surface;  ///< points of it; where it was not looked at: its frustum counts
  ImageDepth depth;            ///< its undistorted picture; empty: not looked at
  std::optional<Pose> T_world_depth;  ///< when the picture was taken
};

struct SampleConfig {
  int most_sensors = 32;  ///< of scenes with more sensors, only kSamples are looked at
  static constexpr int kSamples = 8;
  std::function<void(std::size_t done, std::size_t of)> progress{};
  std::function<void(const std::string&)> notice{};  ///< one line each
};

/// One frame of each sensor, reconstructed as its node would. In a scene of too many sensors only
/// some are looked at: all get the mean of their triangles, and their frusta count. A sensor whose
/// frame cannot be had keeps the default. The scene must be prepared (prepare_scene).
std::vector<SensorSample> sample_sensors(const Scene& scene, const std::filesystem::path& rig_cache,
                                         const SampleConfig& config);

}  // namespace mr::planner
