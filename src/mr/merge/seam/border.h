#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// All parts side by side in one mesh whose borders do not touch themselves: at most one border
/// edge starts at a vertex, and one ends.
struct Joined {
  Mesh mesh;                          ///< without labels
  std::vector<SensorId> sensor;       ///< [T] that measured it
  std::vector<std::uint32_t> part;    ///< [V] which one a vertex belongs to
  std::vector<std::uint32_t> border;  ///< half-edges with nothing on the other side, ascending
  bool came_apart = false;  ///< at edges that were not manifold, which lie there several times
};

/// Puts parts side by side. Fans of triangles that meet in a vertex only get a vertex each, and
/// edges of more than two triangles, or of two wound alike, come apart (paper 3.2: borders are
/// found by counting the neighbours of an edge).
Joined join_parts(std::span<const Mesh> parts);

}  // namespace mr::merge
