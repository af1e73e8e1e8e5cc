#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/pair_map.h"
#include "mr/kit/topology.h"

namespace mr::merge {

/// The open borders of a mesh as loops of half-edges with the surface on their left and the gap on
/// their right, and the one step that closes gaps: a triangle from a border edge to a border
/// corner.
class Front {
 public:
  /// `border`: the mesh's half-edges with nothing on the other side; at most one starts at a
  /// vertex, and one ends (see join_parts). `wanted`: [border] those that are looked at; they may
  /// be chains: the first has itself as `prev`, the last has itself as `next`.
  Front(const Mesh& mesh, std::span<const std::uint32_t> border,
        std::span<const std::uint8_t> wanted);

  struct Edge {
    std::uint32_t from = 0, to = 0;
    std::uint32_t next = 0, prev = 0;
    bool alive = true;
    std::uint32_t sibling = kNone;  // the next live edge from the same vertex
  };
  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;

  std::size_t size() const { return edges_.size(); }  ///< edges ever; dead ones included
  const Edge& edge(std::uint32_t e) const { return edges_[e]; }
  /// The first of the live edges that start at a vertex, or kNone; `sibling` leads on. Each is one
  /// corner of a border.
  std::uint32_t corner_at(std::uint32_t vertex) const { return corner_[vertex]; }

  /// From an edge into the gap, over both of its ends' surfaces: tips lie on this side.
  Vec3f into_gap(std::uint32_t e) const {
    const auto [u, v] = std::pair(edges_[e].from, edges_[e].to);
    return cross(normals_[u] + normals_[v], at(u) - at(v));
  }

  /// Whether the triangle over edge `e` with the tip at a vertex faces like the surface around.
  bool faces_alike(std::uint32_t e, std::uint32_t tip) const {
    constexpr float kFacing = 0.05f;  // cosine to the normal at each corner
    const std::uint32_t u = edges_[e].from, v = edges_[e].to;
    const Vec3f across = cross(at(u) - at(v), at(tip) - at(v));
    const float at_u = dot(across, normals_[u]), at_v = dot(across, normals_[v]),
                at_tip = dot(across, normals_[tip]);
    const float least = std::min({at_u, at_v, at_tip});
    if (least <= 0) return false;
    const float size = length(across);
    return size > 1e-12f && least >= kFacing * size;
  }

  /// Whether such a triangle, with the tip at the corner where edge `corner` starts, fills part of
  /// the gap: inside the gap's angle at all three corners, on the right of the edge, and without a
  /// third triangle at any edge.
  bool fits(std::uint32_t e, std::uint32_t corner) const;

  /// Whether the ear over edge `e` and the one after it can be cut off in a loop that is closed at
  /// all costs: no third triangle at any edge, and not facing away from the surface around.
  bool fits_as_ear(std::uint32_t e) const;
  /// The corner that the ear's triangle has its tip at.
  std::uint32_t ear_corner(std::uint32_t e) const { return edges_[edges_[e].next].next; }

  /// Adds that triangle; returns the edges that are new on the border.
  std::vector<std::uint32_t> fill(std::uint32_t e, std::uint32_t corner);

  /// Number of edges of the loop that `e` is on, or nothing when there are more than `limit`.
  std::optional<int> loop_length(std::uint32_t e, int limit) const;

  const std::vector<Triangle>& added() const { return added_; }

 private:
  static constexpr std::uint32_t kInner = 0xFFFFFFFFu;  // not on the border

  Vec3f at(std::uint32_t v) const { return positions_[v]; }
  /// A directed edge by the places of its ends: vertices that join_parts took apart count as
  /// one.
  std::uint64_t directed(std::uint32_t from, std::uint32_t to) const {
    return static_cast<std::uint64_t>(place_[from]) << 32 | place_[to];
  }
  void find_places(const Mesh& mesh, std::span<const std::uint32_t> border);
  std::vector<std::uint8_t> at_places_of_edges(const Mesh& mesh,
                                               std::span<const std::uint32_t> border) const;
  bool edges_are_free(std::uint32_t u, std::uint32_t v, std::uint32_t w) const;
  double turn(std::uint32_t vertex, std::uint32_t reference, std::uint32_t other) const;
  std::uint32_t add_edge(std::uint32_t from, std::uint32_t to);
  void link(std::uint32_t a, std::uint32_t b) { edges_[a].next = b, edges_[b].prev = a; }
  void retire(std::uint32_t e);
  /// Removes a pair of opposite border edges, if `e` has one.
  void close(std::uint32_t e);

  const std::vector<Vec3f>& positions_;
  std::vector<Vec3f> normals_;
  std::vector<std::uint32_t> place_;  // of border vertices: the lowest at the same position
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> corner_;  // [V]
  kit::PairMap
      surface_;  // directed edges of triangles at the border → the live edge there, or kInner
  std::vector<Triangle> added_;
};

}  // namespace mr::merge
