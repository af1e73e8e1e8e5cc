#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/fusion/fuse.h"
#include "mr/node/chunk_grid.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// A changed chunk of a still surface.
struct StillChunk {
  Vec3i cube;
  SurfacePiece piece;  ///< decimated, on the lattice; empty: the chunk is gone
};

/// Reconstructs a sensor's still picture (still::Background) chunk by chunk. Each chunk is
/// decimated separately to an error limit, with border lines that both neighbours simplify alike.
/// So a chunk depends on its own part of the fused surface only: a change affects only the chunks
/// that it touches, and these still fit the others.
class StillSurface {
 public:
  /// The scene must outlive this.
  explicit StillSurface(const Scene& scene);

  /// Takes a filtered still picture. `error_m`: error limit of decimation; if it differs from the
  /// last call's, all chunks are reconstructed. Returns the changed chunks, sorted by cube.
  /// Deterministic; the same on any number of threads.
  Result<std::vector<StillChunk>> update(const ImageDepth& still, const Camera& camera,
                                         const Pose& T_world_camera, const Precision& precision,
                                         double error_m);

  /// Number of chunks.
  std::size_t chunks() const { return fused_.size(); }

 private:
  struct Labelled {
    const Mesh& mesh;
    std::vector<std::uint32_t> chunk;  ///< [T] place in `cubes`
    std::vector<Vec3i> cubes;
    std::vector<std::vector<std::uint32_t>> triangles;  ///< [cubes]
    /// [cubes] those of them that lie near the border line to a neighbour.
    std::vector<std::vector<std::uint32_t>> near_lines;
  };
  /// A chunk's part of the fused surface, with the neighbours' triangles near its border lines, so
  /// that both sides simplify the lines alike.
  struct Part {
    Mesh mesh;
    std::vector<std::uint32_t> chunk;  ///< [T] place in `cubes`
  };
  static Labelled by_cube(const fusion::Surface& surface, const Mesh& mesh);
  static Part part_of(const Labelled& all, std::uint32_t chunk);
  Result<fusion::Surface*> fuse(const ImageDepth& still, const Camera& camera,
                                const Pose& T_world_camera, const Precision& precision);
  Result<StillChunk> decimate(const Part& part, std::uint32_t chunk, Vec3i cube,
                              double error_m) const;

  const Scene* scene_;
  fusion::FrameFuser fuser_;
  std::map<Vec3i, std::uint64_t> fused_;  ///< hash of each chunk's input
  double error_m_ = 0;                    ///< limit of the last decimation
};

}  // namespace mr::node
