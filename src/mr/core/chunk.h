#pragma once

#include <array>
#include <cstddef>
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

/// `count` triangles from `first` on.
struct TriangleRange {
  std::uint32_t first = 0, count = 0;

  friend bool operator==(const TriangleRange&, const TriangleRange&) = default;
};

/// Whether ranges are ascending, not empty, do not touch, and lie in so many triangles.
inline bool are_apart(const std::vector<TriangleRange>& ranges, std::uint32_t triangles) {
  std::uint64_t end = 0;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    if (ranges[i].count == 0 || (i > 0 && ranges[i].first <= end)) return false;
    end = std::uint64_t{ranges[i].first} + ranges[i].count;
    if (end > triangles) return false;
  }
  return true;
}

/// The unit of transport and of reuse: one coded mesh.
struct EncodedChunk {
  ChunkKey key;
  float error_m = 0;            ///< geometric error made so far
  std::uint32_t triangles = 0;  ///< before coding; checked after decoding
  /// What the stream's labels mean, at most 254: as in the mesh, of one kind at most.
  std::vector<SensorId> sensors{};
  std::vector<ViewId> views{};
  SharedBytes payload;  ///< Draco, Edgebreaker
  /// Which triangles, in the stream's order, no sensor measured (merge.fill_m): ascending, apart.
  std::vector<TriangleRange> guessed{};

  friend bool operator==(const EncodedChunk&, const EncodedChunk&) = default;
};

struct Chunk {
  ChunkKey key;
  float error_m = 0;
  Mesh mesh;                            ///< vertices on the scene's lattice
  std::vector<std::uint8_t> guessed{};  ///< [T] 1: no sensor measured the triangle; empty: none
  std::vector<std::array<std::uint8_t, 3>> colors{};  ///< [V] sRGB; background chunks, points
  float point_m = 0;  ///< over 0: no triangles, each vertex is a point of this diameter
};

}  // namespace mr
