#pragma once

#include "mr/core/mesh.h"

namespace mr::baseline {

struct Decimated {
  Mesh mesh;
  float error_m = 0;
};

/// Parallel decimation to about `ratio` of the triangles: the mesh is divided into cubes, which are
/// decimated independently with their shared vertices fixed and joined without cracks; then again
/// with cubes shifted by half an edge, so that the former borders are decimated, too.
Decimated decimate(const Mesh& mesh, double ratio, double cube_m);

}  // namespace mr::baseline
