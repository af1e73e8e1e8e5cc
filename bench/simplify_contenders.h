#pragma once

#include <vector>

#include "race.h"
#include "simplify_case.h"

namespace mr::bench {

/// Contenders of decimation. Converting our mesh to a peer's type and back is not timed but counts
/// as the peer's memory. The case must outlive them.

Contender simplify_ours(const SimplifyCase& input, int threads);

/// Whether this was built with meshoptimizer.
bool has_meshoptimizer();

/// The whole mesh at once, without an error limit, on one thread (it is single-threaded); and for
/// each number of threads on patches of at most 25,000 vertices with locked borders. Empty: built
/// without meshoptimizer.
std::vector<Contender> simplify_meshoptimizer(const SimplifyCase& input,
                                              const std::vector<int>& threads);

/// A textbook implementation of Garland & Heckbert 1997: one thread, one heap of edges; the method
/// of the paper's Fig. 2.
Contender simplify_heap(const SimplifyCase& input);

/// TriangleMesh::SimplifyQuadricDecimation, one thread. Empty: built without Open3D.
std::vector<Contender> simplify_open3d(const SimplifyCase& input);

/// Whether this was built with CGAL.
bool has_cgal();

/// Surface_mesh_simplification by Garland and Heckbert's rules, one thread. Empty: built without
/// CGAL.
std::vector<Contender> simplify_cgal(const SimplifyCase& input);

}  // namespace mr::bench
