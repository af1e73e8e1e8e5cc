#pragma once

#include <memory>
#include <vector>

#include "mr/render/scene_geometry.h"

namespace mr::render {

/// The triangles and points of the scene that was drawn last, on the graphics card. Its context
/// must be current and frees what is there.
class SceneBuffers {
 public:
  /// Once, before all else.
  void set_up();

  /// Brings the scene's chunks to the card unless they are there: drawing one scene from many
  /// viewpoints gathers it once. Errors as gather().
  Status keep(const DecodedScene& scene);

  /// What is there. Positions, indices and colours are on the card only.
  const SceneGeometry& geometry() const { return geometry_; }

 private:
  bool holds(const DecodedScene& scene) const;
  void upload();

  unsigned vertices_ = 0, colors_ = 0, indices_ = 0;
  SceneGeometry geometry_;
  std::vector<std::weak_ptr<const Chunk>> chunks_;  ///< what was gathered; chunks never change
};

}  // namespace mr::render
