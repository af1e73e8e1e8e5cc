#pragma once

#include <span>

#include "mr/simplify/working_mesh.h"
#include "mr/simplify/working_mesh_builder.h"

namespace mr::simplify {

/// Simplifies the lines where triangles of different chunks meet, each on its own (Douglas &
/// Peucker 1973): no vertex that goes lies farther than `error_m` from the line that is left. What
/// stays of them is fixed from then on. A line ends where a third chunk, a real border or a complex
/// vertex begins; those stay.
void simplify_chunk_lines(std::span<const Label> labels, float error_m, WorkingMesh& mesh);

}  // namespace mr::simplify
