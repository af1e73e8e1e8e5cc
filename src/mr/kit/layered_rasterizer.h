#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "mr/core/camera.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/kit/tile_raster.h"

namespace mr::kit {

/// A mesh to draw; the ID of its triangle t is first_triangle + t.
struct LayeredMesh {
  const Mesh* mesh = nullptr;
  std::uint32_t first_triangle = 0;
};

/// Rasterizes all front-facing triangles, hidden ones included, into an A-buffer: a list of depth
/// layers per pixel (Carpenter 1984; also known as layered depth image). Tile-based: each tile's
/// A-buffer is processed while it is in the cache, and none of the whole picture exists. Reuses its
/// memory between cameras.
///
/// Unlike in rasterize(), vertices are snapped to 1/2048 pixel, so that edge functions are exact
/// and the rasterization is watertight: a ray through a shared edge hits exactly one of its two
/// triangles. The near plane is at kNearPlane_m.
class LayeredRasterizer {
 public:
  LayeredRasterizer();
  ~LayeredRasterizer();
  LayeredRasterizer(const LayeredRasterizer&) = delete;
  LayeredRasterizer& operator=(const LayeredRasterizer&) = delete;

  /// Receives the index of a tile in tiles() and its A-buffer, which it may sort.
  using TileWork = std::function<void(std::size_t, ABuffer&)>;
  /// Calls work(tile, buffer) for each tile; prepare(tiles) once before. The camera is an
  /// undistorted pinhole. Parallel over blocks of triangles, then over tiles; what is drawn does
  /// not depend on the threads.
  void draw(std::span<const LayeredMesh> meshes, const Camera& camera, const Pose& T_world_camera,
            const std::function<void(std::size_t)>& prepare, const TileWork& work);

  /// Of the last draw(). Triangles of one block are in no other.
  std::span<const RasterTile> tiles() const;
  std::size_t block_count() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::kit
