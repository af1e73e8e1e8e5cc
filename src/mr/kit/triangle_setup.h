#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/kit/a_buffer.h"
#include "mr/kit/float4.h"

/// The first stage of the LayeredRasterizer: projects vertices to a subpixel grid, culls triangles
/// and bins them into tiles.
namespace mr::kit {

inline constexpr int kSubpixelBits = 11;
inline constexpr int kSubpixels = 1 << kSubpixelBits;  ///< grid points per pixel and axis

/// Outcodes (as in Cohen-Sutherland clipping): why a vertex is outside the picture or needs
/// clipping.
inline constexpr std::int32_t kLeftOf = 1, kRightOf = 2, kAbove = 4, kBelow = 8, kTooNear = 16,
                              kFarOut = 32;
inline constexpr std::int32_t kOutcodeBase = 0x3f800000;  ///< so that it is no denormal number

/// A vertex in the picture. Floats hold points of the subpixel grid exactly.
struct alignas(16) ProjectedVertex {
  float u, v;  ///< on the subpixel grid
  float inv_z;
  std::int32_t outcode;  ///< and kOutcodeBase

  bool is(std::int32_t what) const { return (outcode & what) != 0; }
};

/// The camera of a draw.
struct RasterView {
  const Camera* camera;  ///< an undistorted pinhole
  Vec3f origin;          ///< world frame
  Mat3 R_world_camera;
};

/// Projects vertices, four at a time; out: [points].
void project_vertices(const RasterView& view, std::span<const Vec3f> points, ProjectedVertex* out);

/// A projected triangle with positive winding: u, v and 1 / depth of its corners, and its inclusive
/// bounding box of pixels.
struct alignas(16) ScreenTriangle {
  std::array<float, 3> a;
  std::uint32_t triangle_and_wide;  ///< the highest bit: 16 pixels or more across
  std::array<float, 3> b;
  std::int16_t left, top;
  std::array<float, 3> c;
  std::int16_t right, bottom;

  std::uint32_t triangle() const { return triangle_and_wide & 0x7fffffffu; }
  bool wide() const { return triangle_and_wide >> 31 != 0; }
};

/// A point of the subpixel grid, also far beyond the picture.
struct SubpixelPoint {
  std::int64_t u = 0, v = 0;
};

/// A triangle, or part of one after near-plane clipping, that crosses the near plane, reaches far
/// beyond the picture or is very large.
struct ClippedTriangle {
  std::array<SubpixelPoint, 3> corners;
  double at_origin, per_x, per_y;  ///< 1 / depth over the picture
  float nearest, farthest;         ///< limits of it
  std::uint32_t triangle;
  int top, bottom;
};

/// The division of a picture into tiles.
struct TileGrid {
  int across = 0, down = 0;

  explicit TileGrid(const Camera& camera)
      : across((camera.width + kTileColumns - 1) >> kTileColumnBits),
        down((camera.height + kTileRows - 1) >> kTileRowBits) {}
  std::size_t count() const { return static_cast<std::size_t>(across) * down; }
};

/// The result of triangle setup for a range of one mesh's triangles in one camera's picture.
struct TriangleBlock {
  static constexpr std::uint32_t kMost = 4096;   ///< triangles; places in it take 16 bits
  std::uint32_t mesh = 0, first = 0, count = 0;  ///< triangles of the mesh
  std::vector<ScreenTriangle> on_screen;
  std::vector<std::uint32_t> first_in;  ///< [tiles + 1] tile → its first place in `in_tile`
  std::vector<std::uint16_t> in_tile;   ///< of `on_screen`, tile by tile, ascending
  std::vector<std::uint32_t> to_clip;   ///< triangles of the mesh

  std::span<const std::uint16_t> in(std::size_t tile) const {
    return {in_tile.data() + first_in[tile], in_tile.data() + first_in[tile + 1]};
  }
};

/// Collects the triangles of a block that face the camera and cover pixels, and those to be
/// clipped. `first_of_mesh` is added to triangle IDs.
void set_up_triangles(const Mesh& mesh, const ProjectedVertex* vertices,
                      std::uint32_t first_of_mesh, const Camera& camera, TriangleBlock& block);

/// Bins a block's triangles into tiles.
void sort_into_tiles(const TileGrid& tiles, TriangleBlock& block);

/// Clips a triangle at the near plane in double precision and adds its visible parts to `out`.
void clip_triangle(const RasterView& view, const Mesh& mesh, const ProjectedVertex* vertices,
                   std::uint32_t triangle, std::uint32_t first_of_mesh,
                   std::vector<ClippedTriangle>& out);

/// The edge function of the line from p to q: not negative on the triangle's side; a point on the
/// line is inside for one of its two directions (a fill rule).
inline std::int64_t edge_function(SubpixelPoint p, SubpixelPoint q, std::int64_t u,
                                  std::int64_t v) {
  const std::int64_t per_u = p.v - q.v, per_v = q.u - p.u;
  const bool other_way = per_u < 0 || (per_u == 0 && per_v < 0);
  return per_u * (u - p.u) + per_v * (v - p.v) - other_way;
}

}  // namespace mr::kit
