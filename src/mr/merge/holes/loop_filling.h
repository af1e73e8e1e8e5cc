#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::merge {

/// Triangulates a loop of `corners` points with the least sum of costs (Barequet and Sharir 1995,
/// by dynamic programming; Liepa 2003). `cost(i, j, k)`, i < j < k: of the triangle {k, j, i}, or
/// nothing: there must be no such triangle. Triangles are of indices into the loop and fit a loop
/// with the surface on its left. Nothing: none is allowed. Takes O(corners^3).
std::optional<std::vector<Triangle>> least_filling(
    std::uint32_t corners,
    const std::function<std::optional<double>(std::uint32_t, std::uint32_t, std::uint32_t)>& cost);

}  // namespace mr::merge
