#pragma once

#include <vector>

#include "mr/core/chunk.h"
#include "mr/core/colored_mesh.h"
#include "mr/core/lattice.h"
#include "mr/core/result.h"

namespace mr::codec {

/// Encodes a background model as chunks, sorted by key: source kBackgroundSource, level 0, version
/// 1, colours per vertex. A triangle belongs to the cube of edge `chunk_m` that contains its
/// centroid; neighbouring chunks share their border vertices and the colours of these. Vertices
/// that snap to one lattice point are welded and get their mean colour, for example along the seams
/// of texture charts. The same bytes on any number of threads.
///
/// Errors: empty; invalid if it extends beyond the lattice; too_large for more than 32,768
/// cubes, or 2^20 triangles in one.
Result<std::vector<EncodedChunk>> encode_background(const ColoredMesh& background,
                                                    const Lattice& lattice, double chunk_m);

}  // namespace mr::codec
