#pragma once

#include "mr/core/mesh.h"

namespace mr::baseline {

struct Decimated {
  Mesh mesh;
  float error_m = 0;
};

/// Keeps about `ratio` of the triangles, working on all cores: the mesh is cut into cubes, which
/// are decimated apart with the vertices that they share in place, joined again without a crack,
/// and cut into other cubes, half an edge off, so that what was a border before is decimated, too.
Decimated decimate(const Mesh& mesh, double ratio, double cube_m);

}  // namespace mr::baseline
