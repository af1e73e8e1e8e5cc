#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"

namespace mr::render {

/// What one chunk adds to a range.
struct ScenePart {
  std::size_t first_index = 0, indices = 0;
  std::uint32_t chunk = 0;  ///< its place in the scene
};

/// What is painted in one way: the triangles of all chunks of a layer that carry one view's label,
/// those that have colours of their own, or points of one size.
struct ViewRange {
  ViewId view = kNoView;
  Layer layer = Layer::moving;  ///< where it has a view
  bool colored = false;         ///< then without a view
  float point_m = 0;            ///< over 0: points of this diameter
  std::size_t first_part = 0, parts = 0;
};

/// A scene as the graphics card takes it. A point is a triangle whose three corners lie in one
/// place: the vertex shader moves them apart.
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
