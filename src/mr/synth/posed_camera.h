#pragma once

#include <functional>

#include "mr/core/camera.h"
#include "mr/core/parallel.h"
#include "mr/core/pose.h"

namespace mr::synth {

inline constexpr float kFarAway_m = 200;

/// A camera with its pose in the world; generates the rays of its pixels.
struct PosedCamera {
  Camera camera;
  Pose T_world_camera;

  Vec3f origin() const { return vec_cast<float>(T_world_camera.translation); }
  /// World-frame direction of a pixel's ray. A pinhole's has z = 1 in the camera frame, so that
  /// distances along it are depths; other cameras' have unit length, so that they are ranges.
  Vec3f ray(double x, double y) const {
    return vec_cast<float>(T_world_camera.rotation * unproject(camera, {x, y}));
  }
};

/// Calls body(y) for every row, in parallel.
inline void for_rows(int height, const std::function<void(int)>& body) {
  parallel_for(height, 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) body(static_cast<int>(y));
  });
}

}  // namespace mr::synth
