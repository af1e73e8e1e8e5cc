#pragma once

#include <array>
#include <cstdint>
#include <span>
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

/// Number of edges with more than two triangles.
std::size_t count_nonmanifold_edges(const Mesh& mesh);
/// Number of edges with one triangle.
std::size_t count_boundary_edges(const Mesh& mesh);

/// [V] 1 for vertices whose triangles do not form a closed fan: on a border, at a non-manifold
/// edge, or where the winding is inconsistent.
std::vector<std::uint8_t> border_vertices(const Mesh& mesh);

/// Merges vertices at identical positions, drops triangles that thereby lose a corner, doubled
/// triangles (same corners, any rotation) and unused vertices; views are kept.
Mesh weld(const Mesh& mesh);

/// For every vertex the lowest vertex at the same position.
std::vector<std::uint32_t> same_place(const std::vector<Vec3f>& positions);

/// Removes the smallest triangles at non-manifold edges (more than two triangles, or two with
/// inconsistent winding) until none is left; views are kept.
Mesh without_nonmanifold_edges(const Mesh& mesh);

/// Connected components of triangles across shared manifold edges; parts that touch only in a
/// vertex are separate.
struct Components {
  std::vector<std::uint32_t> of_triangle;  ///< [T]
  std::vector<double> area_m2;             ///< per component
};
Components components(const Mesh& mesh);

/// The triangles at each vertex, in order: those of v are triangle[start[v]] .. [start[v + 1]].
struct VertexFans {
  std::vector<std::uint32_t> start, triangle;

  explicit VertexFans(const Mesh& mesh);
  std::span<const std::uint32_t> at(std::uint32_t v) const {
    return std::span(triangle).subspan(start[v], start[v + 1] - start[v]);
  }
};

/// Unit normals per vertex, weighted by area; zero where nothing meets.
std::vector<Vec3f> vertex_normals(const Mesh& mesh);

/// vertex_normals() smoothed by `rounds` averages over the one-ring: the orientation of the surface
/// at the scale of several edges, without sensor noise.
std::vector<Vec3f> smooth_normals(const Mesh& mesh, int rounds);

/// A mesh with edges split at their midpoints, and the origin of each triangle.
struct Refined {
  Mesh mesh;
  std::vector<std::uint32_t> parent;  ///< [T'] triangle of the input
  std::vector<std::array<std::uint32_t, 2>>
      cut_edges;  ///< [V' - V] the ends of the edge that each new vertex lies on
};

/// Splits every edge for which `split` ([3T], per half-edge) is set on any of its half-edges; all
/// triangles at an edge are split, so there are no T-junctions. Vertices of the input keep their
/// index; views are not copied (use `parent`).
Refined refine(const Mesh& mesh, const std::vector<std::uint8_t>& split);

/// What refine_in_place() did.
struct Cuts {
  std::vector<std::uint32_t> changed;  ///< triangles that were cut; their first piece replaces them
  std::vector<std::uint32_t> parent;   ///< of each triangle that was appended
  std::vector<std::array<std::uint32_t, 2>> cut_edges;  ///< as Refined has them
};

/// The same as refine() with the pieces in another order, so that only what is cut is written: the
/// first piece of a triangle in its place, the others at the end.
Cuts refine_in_place(Mesh& mesh, const std::vector<std::uint8_t>& split);

}  // namespace mr::kit
