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

/// A mesh to draw; its triangle t has the number first_triangle + t.
struct LayeredMesh {
  const Mesh* mesh = nullptr;
  std::uint32_t first_triangle = 0;
};

/// Draws all triangles that face a camera, hidden ones too, into an A-buffer: a list of depth
/// layers per pixel (Carpenter 1984; a layered depth image). The picture is drawn in tiles, and
/// each tile is worked on while it is at hand: no A-buffer of the whole picture is kept. It keeps
/// its memory from camera to camera.
///
/// Unlike rasterize(), vertices are rounded to 1/2048 pixel, where edge functions are exact: a ray
/// through an edge that two triangles share meets one of them. Depths begin at kNearPlane_m.
class LayeredRasterizer {
 public:
  LayeredRasterizer();
  ~LayeredRasterizer();
  LayeredRasterizer(const LayeredRasterizer&) = delete;
  LayeredRasterizer& operator=(const LayeredRasterizer&) = delete;

  /// Gets the place of a tile in tiles(), and its A-buffer, which it may sort.
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
