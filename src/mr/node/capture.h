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

/// Reads the undistorted frames of all sensors of a scene, without nodes: for baselines, references
/// and features.
class CaptureReader {
 public:
  /// The scene must be prepared (prepare_scene). `cache_folder`: cache of rendered
  /// synthetic rigs; empty: none.
  CaptureReader(const Scene& scene, const std::filesystem::path& cache_folder);

  /// The next frame of every sensor that delivers one, by sensor; nothing when all have ended.
  /// `dropped` is called for each lost frame.
  std::optional<std::vector<Frame>> next(
      const std::function<void(SensorId sensor, const Error&)>& dropped = {});

  /// Skips this many frames without reading them; cheap.
  void skip(std::uint64_t frames);

 private:
  std::vector<std::unique_ptr<FrameSource>> sources_;
  std::vector<sensor::Registration> registrations_;
};

/// The depth picture for fusion: filtered as the scene says (fusion::clean_depth), floor removed.
/// `camera`: the undistorted depth camera of the frame's sensor. `readings`: number of readings
/// that each pixel is the mean of.
ImageDepth prepare_depth(const Scene& scene, const Camera& camera, const Frame& frame,
                         int readings = 1);

}  // namespace mr::node
