#pragma once

#include <vector>

#include "mr/core/mesh.h"

namespace mr::codec {

/// Makes triangles of no area go without leaving a crack: where three corners lie in a row, the
/// edge over the middle one is turned, so that the neighbour behind it is split there. What has no
/// neighbour, and what is still flat after a few rounds, is left as it is. `cells`: [V] positions;
/// `labels`: [T], kept in step; the pieces take the neighbour's.
void turn_flat_edges(const std::vector<Vec3i>& cells, std::vector<Triangle>& triangles,
                     std::vector<std::uint32_t>& labels);

/// Whether a triangle's corners lie in a row.
bool is_flat(const std::vector<Vec3i>& cells, const Triangle& t);

}  // namespace mr::codec
