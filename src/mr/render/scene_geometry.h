#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"

namespace mr::render {

/// The part of a ViewRange that comes from one chunk.
struct ScenePart {
  std::size_t first_index = 0, indices = 0;
  std::uint32_t chunk = 0;  ///< index in the scene
};

/// A batch drawn with one state: the triangles of a layer's chunks with one view's label, triangles
/// with vertex colours, or points of one size.
struct ViewRange {
  ViewId view = kNoView;
  Layer layer = Layer::moving;  ///< where it has a view
  bool colored = false;         ///< then without a view
  float point_m = 0;            ///< over 0: points of this diameter
  std::size_t first_part = 0, parts = 0;
};

/// A scene as vertex and index arrays. A point is a degenerate triangle that the vertex shader
/// expands.
struct SceneGeometry {
  Vec3d origin;                        ///< whole metres, in the middle of the scene
  std::vector<Vec3f> positions;        ///< metres from the origin, along the world's axes
  std::vector<std::uint32_t> indices;  ///< [3 (T + points)] grouped by range
  std::vector<std::array<std::uint8_t, 3>> colors;  ///< [V] sRGB; empty where none is coloured
  std::uint32_t first_point = 0;                    ///< vertex from which on all are points'
  std::vector<ViewRange> ranges;                    ///< by view; what has none is last
  std::vector<ScenePart> parts;                     ///< grouped by range, in the indices' order
  std::vector<Box3f> boxes;                         ///< [chunks] metres from the origin
};

/// Brings the chunks together, run by run. Lattice positions lose nothing by it. invalid when a
/// triangle names a vertex that is not there, a position is not finite, a chunk has colours for
/// some vertices only, or both points and triangles.
Result<SceneGeometry> gather(const DecodedScene& scene);

}  // namespace mr::render
