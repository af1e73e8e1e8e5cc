#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// All parts concatenated into one mesh whose borders are simple loops: at most one border edge
/// starts and one ends at a vertex.
struct Joined {
  Mesh mesh;                          ///< without labels
  std::vector<SensorId> sensor;       ///< [T] that measured it
  std::vector<std::uint32_t> part;    ///< [V] which one a vertex belongs to
  std::vector<std::uint32_t> border;  ///< half-edges without a twin, ascending
  bool came_apart = false;            ///< true: non-manifold edges were duplicated
};

/// Concatenates parts. Non-manifold vertices, where fans of triangles meet only in the vertex, are
/// duplicated per fan; edges with more than two triangles, or with two of inconsistent winding, are
/// split apart (paper 3.2: borders are found by counting the neighbours of an edge).
Joined join_parts(std::span<const Mesh> parts);

}  // namespace mr::merge
