#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// The vertices around an open border, with the surface on their left and the gap on their right.
using BorderLoop = std::vector<std::uint32_t>;

/// The open borders of a mesh. Where borders meet in a vertex each goes on around the triangles
/// that it is the border of; one that passes a vertex twice is two loops. No loop has a vertex
/// twice. Ordered by the mesh's triangles.
std::vector<BorderLoop> border_loops(const Mesh& mesh);

}  // namespace mr::merge
