#pragma once

#include <cstdint>
#include <vector>

#include "mr/simplify/shrinking_mesh.h"

namespace mr::simplify {

/// Numbers the vertices that are left, in order: [v] of those that live. Returns how many.
std::uint32_t number_vertices(const ShrinkingMesh& mesh, std::vector<std::uint32_t>& number);

/// Copies what is left of a mesh close together: what lies near in memory is near in space again.
/// `number` is room to work in.
void compact(const ShrinkingMesh& from, std::vector<std::uint32_t>& number, ShrinkingMesh& to);

}  // namespace mr::simplify
