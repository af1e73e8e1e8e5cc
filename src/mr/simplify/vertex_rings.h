#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

namespace mr::simplify {

inline constexpr std::uint32_t kNoVertex = 0xFFFFFFFFu;

/// A triangle of a vertex, given by the edge opposite to it: (vertex, a, b) is counter-clockwise.
struct OppositeEdge {
  std::uint32_t a = 0, b = 0;
  std::uint32_t label = 0;
};

/// Mesh connectivity by one-rings: for every vertex the counter-clockwise list of its neighbours.
/// Neighbours i and i + 1 form a triangle with the vertex; in a closed ring (interior vertex) so do
/// the last and the first. A ring is one cache line, and an edge collapse rewrites only the rings
/// around it: nothing is rebuilt or allocated, and threads may work on vertices that share no
/// neighbour. Vertices whose triangles are not a single fan of at most kMost neighbours
/// (non-manifold ones, or those of high valence) are *complex*: they keep an unordered list of
/// triangles and are never removed.
class VertexRings {
 public:
  static constexpr std::uint32_t kMost = 16;
  using Line = std::array<std::uint32_t, kMost>;

  /// Allocates so many vertices, each of which must be cleared. `labels`: triangles have labels.
  void start(std::size_t vertices, bool labels);
  void clear(std::uint32_t v) { size_[v] = 0; }

  /// First all triangles are added, in any order, up to kFew per vertex. False: v is full.
  bool add(std::uint32_t v, const OppositeEdge& triangle);
  /// Then each vertex's triangles, and `more` for which there was no room, are sorted into a ring.
  /// False: v is complex, and `all` receives its triangles for set_complex().
  bool close(std::uint32_t v, std::span<const OppositeEdge> more, std::vector<OppositeEdge>& all);
  /// Not thread-safe.
  void set_complex(std::uint32_t v, std::vector<OppositeEdge> triangles);

  /// Copies vertex `v` of another mesh as vertex `as`; `number`: new numbers of its vertices.
  void copy(const VertexRings& from, std::uint32_t v, const std::vector<std::uint32_t>& number,
            std::uint32_t as);
  /// Copies the complex vertices, after all others. Not thread-safe.
  void copy_complex(const VertexRings& from, const std::vector<std::uint32_t>& number);

  bool alive(std::uint32_t v) const { return size_[v] != 0; }
  bool is_complex(std::uint32_t v) const { return size_[v] == kComplex; }
  bool has_labels() const { return !labels_.empty(); }
  // Of vertices that are not complex; lanes past the size are kNoVertex.
  const Line& ring(std::uint32_t v) const { return rings_[v]; }
  const Line& labels(std::uint32_t v) const { return labels_[v]; }  ///< of the triangle after [i]
  std::uint32_t size(std::uint32_t v) const { return size_[v]; }
  bool is_open(std::uint32_t v) const { return open_[v] != 0; }
  std::uint32_t triangles(std::uint32_t v) const { return size_[v] - open_[v]; }

  /// Calls each(triangle) for all triangles of v.
  template <typename Each>
  void visit(std::uint32_t v, const Each& each) const;

  /// The link condition (Dey et al. 1999): whether v can be collapsed into its neighbour `i`
  /// without changing the topology: no edge gets a third triangle, no two triangles the same
  /// corners, and no component vanishes; moreover no ring may grow too long. In an open ring `i`
  /// must be an end.
  bool may_collapse(std::uint32_t v, std::uint32_t i) const;
  /// Collapses v into its neighbour `i`. Returns the number of triangles removed.
  std::uint32_t collapse(std::uint32_t v, std::uint32_t i);

 private:
  static constexpr std::uint32_t kFew = kMost / 2;
  static constexpr std::uint8_t kComplex = 255;

  bool may_lose_one(std::uint32_t v) const;
  void rename(std::uint32_t in, std::uint32_t v, std::uint32_t u);
  void remove(std::uint32_t in, std::uint32_t v, std::uint32_t u);
  void remove_from_complex(std::uint32_t in, std::uint32_t v, std::uint32_t u);

  std::vector<Line> rings_, labels_;  // [V]; labels_ may be empty
  std::vector<std::uint8_t> size_;    // [V] neighbours; 0: gone
  std::vector<std::uint8_t> open_;    // [V] 1: the fan has ends
  std::unordered_map<std::uint32_t, std::vector<OppositeEdge>> complex_;
};

inline bool VertexRings::add(std::uint32_t v, const OppositeEdge& triangle) {
  const std::uint32_t n = size_[v];
  if (n == kFew) return false;
  rings_[v][n] = triangle.a, rings_[v][kFew + n] = triangle.b;
  if (has_labels()) labels_[v][n] = triangle.label;
  size_[v] = static_cast<std::uint8_t>(n + 1);
  return true;
}

template <typename Each>
void VertexRings::visit(std::uint32_t v, const Each& each) const {
  if (is_complex(v)) {
    for (const OppositeEdge& triangle : complex_.at(v)) each(triangle);
    return;
  }
  const Line& ring = rings_[v];
  const std::uint32_t n = size_[v], count = triangles(v);
  for (std::uint32_t i = 0; i < count; ++i)
    each(OppositeEdge{ring[i], ring[i + 1 < n ? i + 1 : 0], has_labels() ? labels_[v][i] : 0});
}

}  // namespace mr::simplify
