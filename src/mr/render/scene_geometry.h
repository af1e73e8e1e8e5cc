#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"

namespace mr::render {

/// The triangles of all chunks that one view textures, or of all that have colours of their own.
struct ViewRange {
  ViewId view = kNoView;
  bool colored = false;  ///< then without a view
  std::size_t first_index = 0, indices = 0;
};

/// A scene as the graphics card takes it.
struct SceneGeometry {
  std::vector<Vec3f> positions;        ///< metres from the eye, along the world's axes
  std::vector<std::uint32_t> indices;  ///< [3 T] grouped by view
  std::vector<ViewRange> ranges;       ///< by view; kNoView and what is coloured are last
  std::vector<std::array<std::uint8_t, 3>> colors;  ///< [V] sRGB; empty where none is coloured
};

/// Brings the chunks together, run by run. invalid when a triangle names a vertex that is not
/// there, or a chunk has colours for some vertices only.
Result<SceneGeometry> gather(const DecodedScene& scene, Vec3d eye);

}  // namespace mr::render
