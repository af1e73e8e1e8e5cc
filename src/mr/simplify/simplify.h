#pragma once

#include "mr/core/mesh.h"

namespace mr::simplify {

struct Simplified {
  Mesh mesh;          ///< without runs: labels are chosen after the last decimation
  float error_m = 0;  ///< largest RMS distance of a vertex to the planes that it stands for
};

/// Collapses edges by quadric error (Garland & Heckbert 1997; paper 3.1) until about
/// `target_triangles` are left, then moves inner vertices to where their error is least. Border
/// vertices only go along the border, and those that are left stay where they were; nothing is
/// flipped, no edge gets more triangles than it had, no hole closes and no separate part vanishes,
/// so a mesh of many small parts may keep more triangles than wanted. Vertices where fans of
/// triangles meet in a point stay. A target that the mesh meets already returns it as it is.
/// Single-threaded and deterministic.
Simplified simplify(const Mesh& mesh, std::size_t target_triangles);

/// The same with a share of the triangles, (0, 1].
Simplified simplify_by_ratio(const Mesh& mesh, double ratio);

}  // namespace mr::simplify
