#pragma once

#include "mr/core/chunk.h"
#include "mr/core/lattice.h"
#include "mr/core/result.h"

namespace mr::codec {

/// Puts a mesh on the lattice: snaps every vertex, welds those that meet, drops triangles of no
/// area and doubled ones, drops vertices that nothing uses; views are kept. Refuses (invalid)
/// positions that are not finite or lie outside the lattice's cube, so that they never reach Draco.
Result<Mesh> snap_to_lattice(const Mesh& mesh, const Lattice& lattice);

/// The same, and where the vertices went, for what else belongs to them.
struct Snapped {
  static constexpr std::uint32_t kGone = 0xFFFFFFFFu;
  Mesh mesh;
  std::vector<std::uint32_t> vertex_of;  ///< [V of the input] in `mesh`; kGone: nothing uses it
};
Result<Snapped> snap_vertices(const Mesh& mesh, const Lattice& lattice);

/// Codes a chunk as one Edgebreaker stream (docs/wire-format.md): POSITION on
/// the lattice, and a GENERIC uint8 label per corner where the chunk has more than one view. A
/// background chunk, and no other, has COLOR in its place: [V] colours and triangles of no view.
/// The mesh must be snapped and have runs. `speed`: Draco's, 0 smallest .. 10 fastest. Errors:
/// invalid (not snapped, more than 254 views, colours for another source), empty, corrupt (Draco
/// refused).
Result<EncodedChunk> encode_chunk(const Chunk& chunk, const Lattice& lattice, int speed);

/// Decodes and checks: lattice positions, labels and triangle count as promised, vertices welded,
/// triangles sorted by view. Edgebreaker reorders triangles and vertices. Of two colours at one
/// position the stream's first counts.
Result<Chunk> decode_chunk(const EncodedChunk& chunk, const Lattice& lattice);

}  // namespace mr::codec
