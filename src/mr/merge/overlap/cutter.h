#pragma once

#include <functional>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// Where the margin turns between two vertices: share of the way from the kept to the lost one.
using Crossing = std::function<float(std::uint32_t kept, std::uint32_t lost)>;

/// What lies on the positive side of a function on a mesh: triangles that it turns in are cut, at
/// one point of each edge, so neighbours still share their vertices. A cut that would leave a
/// corner's sliver goes through the corner. `margin`: [V].
struct Cut {
  Mesh mesh;                          ///< without views
  std::vector<std::uint32_t> parent;  ///< [T] triangle of the input
};
Cut cut_at_zero(const Mesh& mesh, const std::vector<float>& margin, const Crossing& crossing);

}  // namespace mr::merge
