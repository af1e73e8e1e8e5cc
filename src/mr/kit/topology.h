#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"

/// Adjacency, borders and components of triangle meshes.
namespace mr::kit {

/// Half-edge 3t + i runs from corner i of triangle t to corner (i + 1) % 3.
inline constexpr std::uint32_t kNoTwin = 0xFFFFFFFFu;

struct EdgeTable {
  std::vector<std::uint32_t>
      twin;  ///< [3T] the half-edge on the other side; kNoTwin on a boundary and
             ///< on edges that are not manifold or not consistently wound
  std::vector<std::uint8_t>
      uses;  ///< [3T] triangles that share the edge: 1 on a boundary (max 255)
};
EdgeTable edge_table(const Mesh& mesh);

inline std::uint32_t edge_from(const Mesh& mesh, std::uint32_t half_edge) {
  return mesh.triangles[half_edge / 3][half_edge % 3];
}
inline std::uint32_t edge_to(const Mesh& mesh, std::uint32_t half_edge) {
  return mesh.triangles[half_edge / 3][(half_edge % 3 + 1) % 3];
}

/// Edges that more than two triangles share.
std::size_t count_nonmanifold_edges(const Mesh& mesh);
/// Edges of one triangle only, counted.
std::size_t count_boundary_edges(const Mesh& mesh);

/// [V] 1 for vertices whose triangles do not close a ring around them: on a border, at an edge of
/// more than two triangles, or where winding changes.
std::vector<std::uint8_t> border_vertices(const Mesh& mesh);

/// Merges vertices at identical positions, drops triangles that thereby lose a corner, doubled
/// triangles (same corners, any rotation) and unused vertices; views are kept.
Mesh weld(const Mesh& mesh);

/// For every vertex the lowest vertex at the same position.
std::vector<std::uint32_t> same_place(const std::vector<Vec3f>& positions);

/// Drops the smallest triangles at edges that more than two share, or two with the same direction,
/// until no such edge is left; views are kept.
Mesh without_nonmanifold_edges(const Mesh& mesh);

/// Triangles are of one component when a chain of shared manifold edges joins them; what hangs on
/// by a vertex only is another.
struct Components {
  std::vector<std::uint32_t> of_triangle;  ///< [T]
  std::vector<double> area_m2;             ///< per component
};
Components components(const Mesh& mesh);

/// Unit normals per vertex, weighted by area; zero where nothing meets.
std::vector<Vec3f> vertex_normals(const Mesh& mesh);

/// vertex_normals(), averaged `rounds` times over the neighbours: what the surface faces at a scale
/// of several edges, without the bumps of sensor noise.
std::vector<Vec3f> smooth_normals(const Mesh& mesh, int rounds);

/// A mesh with edges cut in the middle, and where each triangle came from.
struct Refined {
  Mesh mesh;
  std::vector<std::uint32_t> parent;  ///< [T'] triangle of the input
  std::vector<std::array<std::uint32_t, 2>>
      cut_edges;  ///< [V' - V] the ends of the edge that each new vertex lies on
};

/// Cuts every edge for which `split` ([3T], per half-edge) is set on any of its triangles; all
/// triangles at an edge are cut alike, so no T-junction appears. Vertices of the input keep their
/// index; views are not handed on (use `parent`).
Refined refine(const Mesh& mesh, const std::vector<std::uint8_t>& split);

}  // namespace mr::kit
