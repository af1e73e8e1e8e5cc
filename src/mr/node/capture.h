#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/scene/scene.h"
#include "mr/sensor/registration.h"

namespace mr::node {

/// Reads all sensors of a scene frame by frame, undistorted, without any node: for baselines,
/// references and features.
class CaptureReader {
 public:
  /// The scene must be prepared (prepare_scene). `cache_folder`: of rendered rigs; empty: none.
  CaptureReader(const Scene& scene, const std::filesystem::path& cache_folder);

  /// The next frame of every sensor that delivers one, by sensor; nothing when all have ended.
  /// `dropped`: told about each that was lost.
  std::optional<std::vector<Frame>> next(
      const std::function<void(SensorId sensor, const Error&)>& dropped = {});

  /// Goes on as if so many more had been read; cheap.
  void skip(std::uint64_t frames);

 private:
  std::vector<std::unique_ptr<FrameSource>> sources_;
  std::vector<sensor::Registration> registrations_;
};

/// What fusion takes: depth cleaned as the scene asks for (fusion::clean_depth), without the floor.
/// `camera`: the undistorted depth camera of the frame's sensor. `readings`: how many each pixel is
/// the mean of.
ImageDepth prepare_depth(const Scene& scene, const Camera& camera, const Frame& frame,
                         int readings = 1);

}  // namespace mr::node
