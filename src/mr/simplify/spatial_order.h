#pragma once

#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::simplify {

/// Whether many triangles join vertices whose numbers lie far apart: then neither caches nor ranges
/// of vertices are of use.
bool is_scattered(const Mesh& mesh);

/// A mesh with its vertices in another order, and their weights.
struct ReorderedMesh {
  Mesh mesh;  ///< triangles in their old order
  std::vector<float> weights;
};

/// Sorts the vertices along a Morton curve (1966) through their bounding box.
ReorderedMesh sort_in_space(const Mesh& mesh, std::span<const float> weights);

}  // namespace mr::simplify
