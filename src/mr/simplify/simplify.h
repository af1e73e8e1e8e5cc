#pragma once

#include "mr/core/mesh.h"

namespace mr::simplify {

struct Simplified {
  Mesh mesh;          ///< without runs: labels are chosen after the last decimation
  float error_m = 0;  ///< error actually made
};

/// Collapses edges by quadric error (Garland & Heckbert 1997; paper 3.1) until about
/// `target_triangles` are left. Boundaries keep their course; nothing is flipped. A target that the
/// mesh meets already returns it as it is. Single-threaded and deterministic.
Simplified simplify(const Mesh& mesh, std::size_t target_triangles);

/// The same with a share of the triangles, (0, 1].
Simplified simplify_by_ratio(const Mesh& mesh, double ratio);

}  // namespace mr::simplify
