#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/core/layer.h"
#include "mr/core/mesh.h"
#include "mr/core/shared_bytes.h"

namespace mr {

/// Chunk of a merged mesh: no single sensor made it.
inline constexpr SensorId kMergedSource{0xFFFFFFFFu};
/// Chunk of the background model: it never changes and its vertices carry their colours.
inline constexpr SensorId kBackgroundSource{0xFFFFFFFEu};

/// Which part of the world, below the first merger whose, and which of the two surfaces: what lies
/// in cube c, [c, c + 1) · chunk_m; of the still surface that the root sends, half chunk_m.
struct ChunkId {
  Vec3i cube;
  SensorId source = kMergedSource;
  Layer layer = Layer::moving;

  friend auto operator<=>(const ChunkId&, const ChunkId&) = default;
};

/// Names one content for ever: a version never changes content.
struct ChunkKey {
  ChunkId id;
  std::uint32_t level = 0;  ///< level of detail, 0 the finest
  std::uint32_t version = 0;

  friend auto operator<=>(const ChunkKey&, const ChunkKey&) = default;
};

/// The unit of transport and of reuse: one coded mesh.
struct EncodedChunk {
  ChunkKey key;
  float error_m = 0;            ///< geometric error made so far
  std::uint32_t triangles = 0;  ///< before coding; checked after decoding
  /// What the stream's labels mean, at most 254: as in the mesh, of one kind at most.
  std::vector<SensorId> sensors{};
  std::vector<ViewId> views{};
  SharedBytes payload;  ///< Draco, Edgebreaker

  friend bool operator==(const EncodedChunk&, const EncodedChunk&) = default;
};

struct Chunk {
  ChunkKey key;
  float error_m = 0;
  Mesh mesh;                                          ///< vertices on the scene's lattice
  std::vector<std::array<std::uint8_t, 3>> colors{};  ///< [V] sRGB; background chunks, points
  float point_m = 0;  ///< over 0: no triangles, each vertex is a point of this diameter
};

}  // namespace mr
