#pragma once

#include <cstdint>
#include <vector>

#include "mr/simplify/working_mesh.h"

namespace mr::simplify {

/// Numbers the vertices that are left, in order: [v] of those that live. Returns how many.
std::uint32_t number_vertices(const WorkingMesh& mesh, std::vector<std::uint32_t>& number);

/// Copies what is left of a mesh close together: what lies near in memory is near in space again.
/// `number` is room to work in.
void compact(const WorkingMesh& from, std::vector<std::uint32_t>& number, WorkingMesh& to);

}  // namespace mr::simplify
