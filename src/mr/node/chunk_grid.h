#pragma once

#include <map>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/vec.h"

/// The cubes of chunk_m along whose faces surfaces are cut into chunks.
namespace mr::node {

/// The cube of the chunk grid that a point lies in.
Vec3i cube_of(Vec3d p, double chunk_m);

/// The triangles of a mesh by the cube that holds their centroid, in the mesh's order; labels
/// are kept.
std::map<Vec3i, Mesh> split_by_cube(const Mesh& mesh, double chunk_m);

/// What of a surface lies in one cube.
struct SurfacePiece {
  Mesh mesh;
  float error_m = 0;                    ///< geometric error made so far
  std::vector<std::uint8_t> guessed{};  ///< [T] as in Chunk
};

/// The geometric error that a surface has so far, by cube of the chunk grid, in metres.
class CubeErrors {
 public:
  /// To at least this much.
  void raise(Vec3i cube, float error_m);
  void raise(const CubeErrors& others);
  /// In the cubes of a mesh's triangles, to their vertices' errors. `of_vertices_m`: [V].
  void raise(const Mesh& mesh, const std::vector<float>& of_vertices_m, double chunk_m);

  /// In a cube; where nothing is known of it, around it.
  float at(Vec3i cube) const;
  /// The largest in the cube and its 26 neighbours; of all where nothing is known of these.
  float around(Vec3i cube) const;
  float most_m() const { return most_m_; }

  /// Of a surface with errors `before` that was then decimated: both add up. Decimation moves
  /// triangles, so those around a cube count.
  friend CubeErrors decimated(const CubeErrors& before, const CubeErrors& by_decimation);

 private:
  std::map<Vec3i, float> errors_m_;
  float most_m_ = 0;
};

CubeErrors decimated(const CubeErrors& before, const CubeErrors& by_decimation);

}  // namespace mr::node
