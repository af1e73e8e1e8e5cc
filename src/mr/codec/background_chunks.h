#pragma once

#include <vector>

#include "mr/core/chunk.h"
#include "mr/core/colored_mesh.h"
#include "mr/core/lattice.h"
#include "mr/core/result.h"

namespace mr::codec {

/// A background as chunks, sorted by key: source kBackgroundSource, level 0, version 1, colours per
/// vertex. Triangles go to the cube of `chunk_m` that holds their centroid; neighbours share their
/// border vertices and these vertices' colours. Vertices that meet on the lattice become one with
/// the mean of their colours, as where texture charts meet. The same bytes on any number of
/// threads.
///
/// Errors: empty; invalid where it reaches beyond the lattice; too_large for more than 32,768
/// cubes, or 2^20 triangles in one.
Result<std::vector<EncodedChunk>> encode_background(const ColoredMesh& background,
                                                    const Lattice& lattice, double chunk_m);

}  // namespace mr::codec
