#pragma once

#include <span>
#include <vector>

#include "mr/simplify/builder.h"
#include "mr/simplify/simplify.h"

namespace mr::simplify {

/// What is left of a mesh. `labels`: what the numbers of its triangles mean, empty where they have
/// none; `with_chunks`, `with_sensors`: they tell chunks, runs are wanted. `index` is room to work
/// in.
Simplified output(const ShrinkingMesh& mesh, std::span<const Label> labels, bool with_chunks,
                  bool with_sensors, std::vector<std::uint32_t>& index);

}  // namespace mr::simplify
