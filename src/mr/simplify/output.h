#pragma once

#include <span>
#include <vector>

#include "mr/simplify/simplify.h"
#include "mr/simplify/working_mesh_builder.h"

namespace mr::simplify {

/// Converts the remaining mesh back. `labels`: the meaning of the triangles' label numbers, empty
/// if they have none; `with_chunks`, `with_sensors`: labels hold chunks, or sensors, which become
/// runs. `index` is scratch memory.
Simplified output(const WorkingMesh& mesh, std::span<const Label> labels, bool with_chunks,
                  bool with_sensors, std::vector<std::uint32_t>& index);

}  // namespace mr::simplify
