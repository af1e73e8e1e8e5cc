#pragma once

#include <span>

#include "mr/simplify/working_mesh.h"
#include "mr/simplify/working_mesh_builder.h"

namespace mr::simplify {

/// Simplifies each border line between two chunks independently by the Douglas-Peucker algorithm
/// (1973): removed vertices lie at most `error_m` from the remaining line, whose vertices are fixed
/// afterwards. Lines end at a third chunk, an open border or a non-manifold vertex, which remain.
void simplify_chunk_lines(std::span<const Label> labels, float error_m, WorkingMesh& mesh);

}  // namespace mr::simplify
