#pragma once

#include <memory>
#include <vector>

#include "mr/render/scene_geometry.h"

namespace mr::render {

/// GPU buffers of the triangles and points of the last scene. The OpenGL context must be current;
/// it frees the buffers.
class SceneBuffers {
 public:
  /// Once, before all else.
  void set_up();

  /// Uploads the scene's chunks unless they are there already. Errors as gather().
  Status keep(const DecodedScene& scene);

  /// The layout of the buffers; positions, indices and colours are on the GPU only.
  const SceneGeometry& geometry() const { return geometry_; }

 private:
  bool holds(const DecodedScene& scene) const;
  void upload();

  unsigned vertices_ = 0, colors_ = 0, indices_ = 0;
  SceneGeometry geometry_;
  std::vector<std::weak_ptr<const Chunk>> chunks_;  ///< those uploaded; chunks are immutable
};

}  // namespace mr::render
