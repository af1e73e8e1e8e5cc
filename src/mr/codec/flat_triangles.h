#pragma once

#include <vector>

#include "mr/core/mesh.h"

namespace mr::codec {

/// Removes triangles with collinear corners (zero area) without leaving cracks: flips the longest
/// edge of each, which splits the triangle on the other side of that edge at the middle corner.
/// Triangles without such a neighbour, and those still flat after a few rounds, are kept. `cells`:
/// [V] lattice positions; `labels`: [T], updated with the triangles; both halves of a split
/// triangle keep its label.
void turn_flat_edges(const std::vector<Vec3i>& cells, std::vector<Triangle>& triangles,
                     std::vector<std::uint32_t>& labels);

/// Whether a triangle's corners are collinear.
bool is_flat(const std::vector<Vec3i>& cells, const Triangle& t);

}  // namespace mr::codec
