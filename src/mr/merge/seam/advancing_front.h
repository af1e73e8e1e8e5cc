#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/merge/seam/border.h"

namespace mr::merge {

/// The advancing front of the zipper (as in advancing-front meshing): the open borders of a mesh as
/// loops of half-edges with the surface on their left and the gap on their right, and the step that
/// closes gaps: adding a triangle from a border edge to a border vertex. Steps that share no vertex
/// may run in parallel.
class AdvancingFront {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;

  /// A vertex at the border. Duplicates made by join_parts share a `place`.
  struct Vertex {
    Vec3f at, normal;
    std::uint32_t of_mesh = 0, part = 0;
    std::uint32_t place = 0;          ///< the first vertex at the same position
    std::uint32_t next_here = kNone;  ///< the next one there
    std::uint32_t corner = kNone;     ///< the first live edge that starts here
    std::uint32_t inner = kNone;      ///< of a place: the first edge from it that is not live
  };

  /// A half-edge. Alive: on the border; else it has a triangle on its left and perhaps on its
  /// right.
  struct Edge {
    std::uint32_t from = 0, to = 0;
    std::uint32_t next = 0, prev = 0;
    std::uint32_t sibling = kNone;  ///< the next live edge from the same vertex; or, of those that
                                    ///< are not live, from the same place
    bool alive = false;
  };

  /// The output of steps: a range of free edges, and new triangles. Parallel steps have one each.
  struct Workspace {
    std::uint32_t next = 0, end = 0;  ///< edges
    std::vector<Triangle> added;      ///< of the mesh's vertices
  };

  /// `wanted`: [border] the edges that take part. They may form open chains, whose first edge has
  /// itself as `prev` and whose last has itself as `next`.
  AdvancingFront(const Joined& joined, std::span<const std::uint8_t> wanted);

  std::span<const Vertex> vertices() const { return vertices_; }
  const Vertex& vertex(std::uint32_t v) const { return vertices_[v]; }
  /// Number of edges, dead and unused ones included; the first original() are the initial border.
  std::uint32_t size() const { return static_cast<std::uint32_t>(edges_.size()); }
  std::uint32_t original() const { return original_; }
  const Edge& edge(std::uint32_t e) const { return edges_[e]; }
  /// The first live edge that starts at a vertex, or kNone; `sibling` links to the next one. Each
  /// is one corner of a border.
  std::uint32_t corner_at(std::uint32_t vertex) const { return vertices_[vertex].corner; }

  /// The direction from an edge into the gap, tangential to the surface: new triangles lie there.
  Vec3f into_gap(std::uint32_t e) const {
    const Vertex &u = vertices_[edges_[e].from], &v = vertices_[edges_[e].to];
    return cross(u.normal + v.normal, u.at - v.at);
  }

  /// Whether a triangle of edge `e` and vertex `tip` has a normal like the surface around.
  bool faces_alike(std::uint32_t e, std::uint32_t tip) const {
    constexpr float kFacing = 0.05f;  // cosine to the normal at each corner
    const Vertex &u = vertices_[edges_[e].from], &v = vertices_[edges_[e].to], &w = vertices_[tip];
    const Vec3f across = cross(u.at - v.at, w.at - v.at);
    const float least =
        std::min({dot(across, u.normal), dot(across, v.normal), dot(across, w.normal)});
    if (least <= 0) return false;
    const float size = length(across);
    return size > 1e-12f && least >= kFacing * size;
  }

  /// Whether the triangle of edge `e` and the corner where edge `corner` starts is valid: inside
  /// the gap's angle at all three corners, on the right of the edge, and no edge gets a third
  /// triangle.
  bool fits(std::uint32_t e, std::uint32_t corner) const;

  /// Weaker test for closing a loop by ear clipping: whether the ear of edge `e` and the next edge
  /// gives no edge a third triangle and does not face away from the surface around.
  /// `least_cosine`: of its normal to that at each corner; 0: only to their mean.
  bool fits_as_ear(std::uint32_t e, float least_cosine) const;
  /// The corner opposite to the ear's edge `e`.
  std::uint32_t ear_corner(std::uint32_t e) const { return edges_[edges_[e].next].next; }

  /// Reserves space for so many edges. Not during parallel steps.
  Workspace workspace(std::size_t edges);
  /// One without a limit, for serial use.
  Workspace open_workspace() const { return {size(), kNone, {}}; }
  /// Whether there is room for another step.
  static bool has_room(const Workspace& space) { return space.end - space.next >= kPerStep; }

  /// Adds that triangle. Returns its two other edges that are new on the border, kNone for those
  /// that are not. Accesses only data of the triangle's three vertices.
  std::array<std::uint32_t, 2> fill(std::uint32_t e, std::uint32_t corner, Workspace& space);

  /// Number of edges in the loop of `e`, or nullopt if there are more than `limit`.
  std::optional<int> loop_length(std::uint32_t e, int limit) const;

 private:
  static constexpr std::uint32_t kPerStep = 3;  // edges that a step makes

  std::vector<std::uint32_t> find_vertices(const Joined& joined,
                                           std::span<const std::uint8_t> wanted);
  void look_at_triangles(const Mesh& mesh, std::vector<std::uint32_t> local);
  bool has_inner(std::uint32_t from, std::uint32_t to) const;
  std::uint32_t find_live(std::uint32_t from, std::uint32_t to) const;
  bool edges_are_free(std::uint32_t u, std::uint32_t v, std::uint32_t w) const;
  double turn(std::uint32_t vertex, std::uint32_t reference, std::uint32_t other) const;
  std::uint32_t take(Workspace& space);
  std::uint32_t add_edge(std::uint32_t from, std::uint32_t to, Workspace& space);
  void add_live(std::uint32_t from, std::uint32_t to, std::uint32_t e);
  void add_inner(std::uint32_t e);
  void link(std::uint32_t a, std::uint32_t b) { edges_[a].next = b, edges_[b].prev = a; }
  void retire(std::uint32_t e);
  /// Removes edge `e` and its opposite border edge, if it has one.
  void close(std::uint32_t e);

  std::vector<Vertex> vertices_;
  std::vector<Edge> edges_;
  std::uint32_t original_ = 0;
};

}  // namespace mr::merge
