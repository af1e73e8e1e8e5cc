#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// What may fill a loop; of indices into it.
struct FillingRule {
  /// Whether there may be an edge from i to k > i that is not the loop's.
  std::function<bool(std::uint32_t i, std::uint32_t k)> may_join;
  /// Cost of the triangle {k, j, i}, i < j < k; nothing: there must be no such triangle.
  std::function<std::optional<double>(std::uint32_t i, std::uint32_t j, std::uint32_t k)> cost;
};

/// Triangulates a loop of `corners` points with the least sum of costs (Barequet and Sharir 1995,
/// by dynamic programming; Liepa 2003). Triangles are of indices into the loop and fit a loop with
/// the surface on its left. Nothing: no triangulation is allowed. Takes O(corners^2), and
/// O(corners) for each edge that may be.
std::optional<std::vector<Triangle>> least_filling(std::uint32_t corners, const FillingRule& rule);

}  // namespace mr::merge
