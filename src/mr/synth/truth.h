#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/synth/room.h"

namespace mr::synth {

/// A surface with a colour at every vertex.
struct ColoredMesh {
  Mesh mesh;
  std::vector<std::array<std::uint8_t, 3>> colors;  ///< [V] 8-bit sRGB
};

/// A noiseless picture of a rig by an arbitrary camera.
struct TruthPicture {
  ImageRgb color;    ///< under a neutral exposure, contact shadows included
  ImageDepth depth;  ///< metres along z, or range; to the millimetre; 0 where nothing is met
};

/// Renders the ground truth for one camera. The empty room is rendered once; afterwards frames with
/// few people in view are cheap. Not thread-safe.
class TruthView {
 public:
  virtual ~TruthView() = default;
  virtual TruthPicture at(std::uint64_t frame) = 0;
};

/// The ground truth of a rig: its noiseless surface and colours, people included. Not thread-safe.
class Truth {
 public:
  Truth(const RigConfig& rig, double fps);
  ~Truth();

  ColoredMesh surface(std::uint64_t frame);
  /// The surface without people and what they move.
  Mesh room();
  /// Must not outlive the truth.
  std::unique_ptr<TruthView> view(const Camera& camera, const Pose& T_world_camera);
  TruthPicture render(const Camera& camera, const Pose& T_world_camera, std::uint64_t frame);

 private:
  struct Impl;
  class CameraView;
  std::unique_ptr<Impl> impl_;
};

/// Writes a binary little-endian PLY; no partial file is left on failure.
Status write_ply(const std::filesystem::path& file, const ColoredMesh& surface);

}  // namespace mr::synth
