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
  double triangles = 10'000;          ///< that it sends each frame
  double area_m2 = 0;                 ///< of its surface; 0: follows from the triangles
  double reconstruct_ms = 0;          ///< of its depth, on this machine; 0: not known
  std::vector<Vec3f> surface;         ///< sample points; empty: not sampled, its frustum is used
  ImageDepth depth;                   ///< its undistorted picture; empty: not sampled
  std::optional<Pose> T_world_depth;  ///< when the picture was taken
};

struct SampleConfig {
  int most_sensors = 32;  ///< in scenes with more sensors, only kSamples are sampled
  static constexpr int kSamples = 8;
  std::function<void(std::size_t done, std::size_t of)> progress{};
  std::function<void(const std::string&)> notice{};  ///< one line each
};

/// Reconstructs one frame of each sensor as its node does. In a scene of too many sensors only some
/// are sampled; the others get their mean number of triangles and are represented by their frusta.
/// A sensor whose frame cannot be read keeps the default. The scene must be prepared
/// (prepare_scene).
std::vector<SensorSample> sample_sensors(const Scene& scene, const std::filesystem::path& rig_cache,
                                         const SampleConfig& config);

}  // namespace mr::planner
