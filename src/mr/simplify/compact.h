#pragma once

#include <cstdint>
#include <vector>

#include "mr/simplify/working_mesh.h"

namespace mr::simplify {

/// Numbers the remaining vertices in order: number[v] for those alive. Returns their count.
std::uint32_t number_vertices(const WorkingMesh& mesh, std::vector<std::uint32_t>& number);

/// Compacts a mesh: copies the remaining vertices without gaps, which restores locality of memory.
/// `number` is scratch memory.
void compact(const WorkingMesh& from, std::vector<std::uint32_t>& number, WorkingMesh& to);

}  // namespace mr::simplify
