#include "mr/kit/layered_rasterizer.h"

#include <algorithm>
#include <mutex>
#include <vector>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::kit {

struct LayeredRasterizer::Impl {
  std::span<const LayeredMesh> meshes;
  std::vector<std::vector<ProjectedVertex>> vertices;  ///< [meshes] and perhaps more
  std::vector<TriangleBlock> blocks;
  std::size_t used_blocks = 0;
  std::vector<ClippedTriangle> clipped;
  std::vector<RasterTile> tiles;
  std::size_t used_tiles = 0;
  std::mutex buffers_lock;
  std::vector<std::unique_ptr<ABuffer>> buffers;

  void plan(const Camera& camera);
  void project(const RasterView& view);
  void set_up(const Camera& camera);
  void clip(const RasterView& view);
  void draw_tile(std::size_t number, ABuffer& buffer);
  void draw_tiles(const TileWork& work);
};

/// Divides the meshes into blocks and the picture into tiles.
void LayeredRasterizer::Impl::plan(const Camera& camera) {
  const TileGrid grid(camera);
  used_tiles = grid.count();
  if (tiles.size() < used_tiles) tiles.resize(used_tiles);
  for (std::size_t i = 0; i < used_tiles; ++i) {
    RasterTile& tile = tiles[i];
    tile.left = static_cast<int>(i % grid.across) * kTileColumns;
    tile.top = static_cast<int>(i / grid.across) * kTileRows;
    tile.columns = std::min(kTileColumns, camera.width - tile.left);
    tile.rows = std::min(kTileRows, camera.height - tile.top);
  }
  used_blocks = 0;
  for (std::uint32_t m = 0; m < meshes.size(); ++m) {
    const auto triangles = static_cast<std::uint32_t>(meshes[m].mesh->triangles.size());
    for (std::uint32_t first = 0; first < triangles; first += TriangleBlock::kMost) {
      if (blocks.size() == used_blocks) blocks.emplace_back();
      TriangleBlock& block = blocks[used_blocks++];
      block.mesh = m, block.first = first;
      block.count = std::min(TriangleBlock::kMost, triangles - first);
    }
  }
}

void LayeredRasterizer::Impl::project(const RasterView& view) {
  constexpr std::size_t kGrain = 8192;
  if (vertices.size() < meshes.size()) vertices.resize(meshes.size());
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const std::span<const Vec3f> points = meshes[m].mesh->positions;
    std::vector<ProjectedVertex>& out = vertices[m];
    if (out.size() < points.size()) out.resize(points.size());
    parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      project_vertices(view, points.subspan(begin, end - begin), out.data() + begin);
    });
  }
}

void LayeredRasterizer::Impl::set_up(const Camera& camera) {
  parallel_for(used_blocks, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      TriangleBlock& block = blocks[i];
      const LayeredMesh& mesh = meshes[block.mesh];
      set_up_triangles(*mesh.mesh, vertices[block.mesh].data(), mesh.first_triangle, camera, block);
      sort_into_tiles(TileGrid(camera), block);
    }
  });
}

void LayeredRasterizer::Impl::clip(const RasterView& view) {
  clipped.clear();
  for (std::size_t i = 0; i < used_blocks; ++i) {
    const LayeredMesh& mesh = meshes[blocks[i].mesh];
    for (const std::uint32_t t : blocks[i].to_clip)
      clip_triangle(view, *mesh.mesh, vertices[blocks[i].mesh].data(), t, mesh.first_triangle,
                    clipped);
  }
}

/// Draws all triangles that lie in a tile.
// Not inlined: inside its caller the compiler runs out of registers.
[[gnu::noinline]] void LayeredRasterizer::Impl::draw_tile(std::size_t number, ABuffer& buffer) {
  constexpr std::size_t kAhead = 12;
  RasterTile& tile = tiles[number];
  buffer.clear();
  std::size_t most = clipped.size();
  for (std::size_t i = 0; i < used_blocks; ++i) most += blocks[i].in(number).size();
  tile.triangles.resize(most), tile.covered.resize(most), tile.first.assign(1, 0);
  std::uint32_t next = 0;
  const auto add = [&](std::uint32_t triangle, std::uint32_t covered) {
    tile.covered[next] = covered;
    tile.triangles[next++] = triangle;
  };
  for (std::size_t i = 0; i < used_blocks; ++i) {
    const std::span<const std::uint16_t> places = blocks[i].in(number);
    const ScreenTriangle* shapes = blocks[i].on_screen.data();
    for (std::size_t k = 0; k < places.size(); ++k) {
      if (k + kAhead < places.size())  // prefetch: a cache miss takes long
        __builtin_prefetch(&shapes[places[k + kAhead]]);
      const ScreenTriangle& shape = shapes[places[k]];
      add(shape.triangle(), kit::draw(shape, tile, next, buffer));
    }
    tile.first.push_back(next);
  }
  for (const ClippedTriangle& one : clipped)
    if (one.top < tile.top + tile.rows && one.bottom >= tile.top)
      add(one.triangle, kit::draw(one, tile, next, buffer));
  tile.triangles.resize(next), tile.covered.resize(next);
}

void LayeredRasterizer::Impl::draw_tiles(const TileWork& work) {
  parallel_for(used_tiles, 1, [&](std::size_t begin, std::size_t end) {
    std::unique_ptr<ABuffer> buffer;
    {
      const std::scoped_lock lock(buffers_lock);
      if (!buffers.empty()) buffer = std::move(buffers.back()), buffers.pop_back();
    }
    if (!buffer) buffer = std::make_unique<ABuffer>();
    for (std::size_t i = begin; i < end; ++i) draw_tile(i, *buffer), work(i, *buffer);
    const std::scoped_lock lock(buffers_lock);
    buffers.push_back(std::move(buffer));
  });
}

LayeredRasterizer::LayeredRasterizer() : impl_(std::make_unique<Impl>()) {}
LayeredRasterizer::~LayeredRasterizer() = default;

void LayeredRasterizer::draw(std::span<const LayeredMesh> meshes, const Camera& camera,
                             const Pose& T_world_camera,
                             const std::function<void(std::size_t)>& prepare,
                             const TileWork& work) {
  MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  const RasterView view{&camera, vec_cast<float>(T_world_camera.translation),
                        T_world_camera.rotation};
  Impl& m = *impl_;
  m.meshes = meshes;
  m.plan(camera);
  m.project(view);
  m.set_up(camera);
  m.clip(view);
  prepare(m.used_tiles);
  m.draw_tiles(work);
  m.meshes = {};
}

std::span<const RasterTile> LayeredRasterizer::tiles() const {
  return {impl_->tiles.data(), impl_->used_tiles};
}
std::size_t LayeredRasterizer::block_count() const { return impl_->used_blocks; }

}  // namespace mr::kit
