#pragma once

#include "child.h"
#include "mr/core/mesh.h"
#include "mr/eval/geometry_error.h"

namespace mr::bench {

/// Positions and triangles; runs are left out.
Message to_message(const Mesh& mesh);
Mesh mesh_from(const Message& message);

/// triangles, vertices, area_m2, nonmanifold_edges.
Message surface_figures(const Mesh& mesh);

/// Distance from samples of one surface to another.
eval::SurfaceDistance distance(const Mesh& from, const Mesh& to);

}  // namespace mr::bench
