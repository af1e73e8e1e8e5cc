#pragma once

#include <vector>

#include "race.h"
#include "simplify_case.h"

namespace mr::bench {

/// A mesh in memory to a decimated one in one run; what turns our mesh into a peer's own kind and
/// back is not timed, but counts as its memory. The case must outlive them.

Contender simplify_ours(const SimplifyCase& input, int threads);

/// Whether meshoptimizer was there when this was built.
bool has_meshoptimizer();

/// The whole mesh at once, without a limit on the error, on one thread, which is all it knows; and
/// for each number of threads on patches of at most 25,000 vertices, whose borders stay as they
/// are. Empty where there is no meshoptimizer.
std::vector<Contender> simplify_meshoptimizer(const SimplifyCase& input,
                                              const std::vector<int>& threads);

/// Garland & Heckbert 1997 as anyone would write it: one thread, one heap of edges. What the
/// paper's Fig. 2 was measured with.
Contender simplify_heap(const SimplifyCase& input);

/// TriangleMesh::SimplifyQuadricDecimation, one thread. Empty where there is no Open3D.
std::vector<Contender> simplify_open3d(const SimplifyCase& input);

/// Whether CGAL was there when this was built.
bool has_cgal();

/// Surface_mesh_simplification by Garland and Heckbert's rules, one thread. Empty where there is no
/// CGAL.
std::vector<Contender> simplify_cgal(const SimplifyCase& input);

}  // namespace mr::bench
