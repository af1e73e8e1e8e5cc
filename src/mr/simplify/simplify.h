#pragma once

#include "mr/core/mesh.h"

namespace mr::simplify {

struct Simplified {
  Mesh mesh;          ///< without runs: labels are chosen after the last decimation
  float error_m = 0;  ///< error actually made
};

/// Collapses edges by quadric error (Garland & Heckbert 1997; paper 3.1) until about `ratio` of the
/// triangles is left. Boundaries keep their course; nothing is flipped. `ratio` 1 returns the mesh as it
/// is. Single-threaded and deterministic.
Simplified simplify(const Mesh& mesh, double ratio);

}  // namespace mr::simplify
