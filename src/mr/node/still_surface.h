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
#include "mr/scene/scene.h"

namespace mr::node {

/// One cube of a still surface that is another than before.
struct StillChunk {
  Vec3i cube;
  Mesh mesh;  ///< decimated, on the lattice; empty: nothing is left of it
  float error_m = 0;
};

/// The surface of a sensor's still picture (still::Background), chunk by chunk. A chunk is
/// decimated on its own to an error limit, with the lines to its neighbours fixed, so it follows
/// from its own part of the fused surface alone: a change makes the chunks that it touches anew,
/// and they fit the others.
class StillSurface {
 public:
  /// The scene must outlive this.
  explicit StillSurface(const Scene& scene);

  /// Takes a cleaned still picture. `error_m`: of decimation; where it is another than before, all
  /// chunks are made anew. Returns the chunks that changed, by cube. Deterministic; the
  /// same on any number of threads.
  Result<std::vector<StillChunk>> update(const ImageDepth& still, const Camera& camera,
                                         const Pose& T_world_camera, const Precision& precision,
                                         double error_m);

  /// How many there are.
  std::size_t chunks() const { return fused_.size(); }

 private:
  struct Labelled {
    const Mesh& mesh;
    std::vector<std::uint32_t> chunk;  ///< [T] place in `cubes`
    std::vector<Vec3i> cubes;
    std::vector<std::vector<std::uint32_t>> triangles;  ///< [cubes]
    /// [cubes] those of them that may be near a neighbour's line.
    std::vector<std::vector<std::uint32_t>> near_lines;
  };
  /// A chunk's part of the fused surface, with the neighbours' triangles near its lines, which are
  /// simplified alike from both sides.
  struct Part {
    Mesh mesh;
    std::vector<std::uint32_t> chunk;  ///< [T] place in `cubes`
  };
  static Labelled by_cube(const fusion::Surface& surface, const Mesh& mesh);
  static Part part_of(const Labelled& all, std::uint32_t chunk);
  Result<StillChunk> decimate(const Part& part, std::uint32_t chunk, Vec3i cube,
                              double error_m) const;

  const Scene* scene_;
  fusion::FrameFuser fuser_;
  std::map<Vec3i, std::uint64_t> fused_;  ///< hash of what each chunk follows from
  double error_m_ = 0;                    ///< to which they were decimated
};

}  // namespace mr::node
