#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"

namespace mr::render {

/// The triangles of all chunks that one view textures.
struct ViewRange {
  ViewId view = kNoView;
  std::size_t first_index = 0, indices = 0;
};

/// A scene as the graphics card takes it.
struct SceneGeometry {
  std::vector<Vec3f> positions;        ///< metres from the eye, along the world's axes
  std::vector<std::uint32_t> indices;  ///< [3 T] grouped by view
  std::vector<ViewRange> ranges;       ///< by view; kNoView is last
};

/// Brings the chunks together, run by run. invalid when a triangle names a vertex that is not
/// there.
Result<SceneGeometry> gather(const DecodedScene& scene, Vec3d eye);

}  // namespace mr::render
