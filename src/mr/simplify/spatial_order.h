#pragma once

#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::simplify {

/// Whether many triangles have vertices whose numbers are far apart, which defeats caches and
/// ranges of vertices.
bool is_scattered(const Mesh& mesh);

/// A mesh with its vertices in another order, and their weights.
struct ReorderedMesh {
  Mesh mesh;  ///< triangles in their old order
  std::vector<float> weights;
};

/// Sorts the vertices along a Morton (Z-order) curve through their bounding box.
ReorderedMesh sort_in_space(const Mesh& mesh, std::span<const float> weights);

}  // namespace mr::simplify
