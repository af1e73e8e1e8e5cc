#pragma once

#include <span>
#include <vector>

#include "mr/simplify/simplify.h"
#include "mr/simplify/working_mesh_builder.h"

namespace mr::simplify {

/// What is left of a mesh. `labels`: what the numbers of its triangles mean, empty where they have
/// none; `with_chunks`, `with_views`: they tell chunks, runs are wanted. `index` is room to work
/// in.
Simplified output(const WorkingMesh& mesh, std::span<const Label> labels, bool with_chunks,
                  bool with_views, std::vector<std::uint32_t>& index);

}  // namespace mr::simplify
