#pragma once

#include <functional>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// The zero of the margin on an edge, as a fraction of the way from its kept to its lost vertex.
using Crossing = std::function<float(std::uint32_t kept, std::uint32_t lost)>;

/// Clips a mesh at the zero level set of a function on its vertices (`margin`, [V]) and keeps the
/// positive side. Crossed triangles are cut at one point of each edge, so that neighbours still
/// share vertices. A cut very near a vertex snaps to it, to avoid slivers.
struct Cut {
  Mesh mesh;                          ///< without views
  std::vector<std::uint32_t> parent;  ///< [T] triangle of the input
};
Cut cut_at_zero(const Mesh& mesh, const std::vector<float>& margin, const Crossing& crossing);

}  // namespace mr::merge
