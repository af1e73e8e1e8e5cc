#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/frame.h"
#include "mr/core/mesh.h"
#include "mr/core/result.h"
#include "mr/eval/geometry_error.h"
#include "mr/scene/scene.h"

namespace mr::synth {
class Truth;
}

/// A scene's surface, and what it is measured against. Scenes must be prepared.
namespace mr::eval {

/// Whether the noiseless surface is known: of a rig, or named by `truth.mesh`.
bool has_true_surface(const Scene& scene);

/// The noiseless surfaces of a scene; the room of a rig is made once, at the first call.
class TrueSurfaces {
 public:
  /// The scene must outlive it.
  explicit TrueSurfaces(const Scene& scene);
  ~TrueSurfaces();

  /// As true_surface().
  Result<Mesh> at(int capture);

 private:
  const Scene& scene_;
  std::unique_ptr<synth::Truth> truth_;
};

/// The noiseless surface at a capture. invalid: `truth.mesh` is no pattern, or its file no mesh.
Result<Mesh> true_surface(const Scene& scene, int capture);

/// One capture's frames, undistorted. `dropped`: a line for each lost frame. empty: there are none.
Result<std::vector<Frame>> read_capture(const Scene& scene, int capture,
                                        const std::filesystem::path& rig_cache,
                                        const std::function<void(const std::string&)>& dropped);

/// The frustums of the depth cameras that delivered; with their true poses where those are known
/// and `exact`.
std::vector<SensorFrustum> delivered_frustums(const Scene& scene, std::span<const Frame> capture,
                                              bool exact);

/// All chunks of a decoded scene.
Mesh shown_surface(const DecodedScene& decoded);

/// The error for a capture that the scene does not have.
Error no_such_capture(const Scene& scene, int capture);

}  // namespace mr::eval
