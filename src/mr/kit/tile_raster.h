#pragma once

#include <cstdint>
#include <vector>

#include "mr/kit/a_buffer.h"
#include "mr/kit/triangle_setup.h"

/// The second stage of the LayeredRasterizer: rasterizes triangles into the A-buffer of one tile.
namespace mr::kit {

/// A tile of the picture and the triangles that overlap it. A triangle's index in the list is the
/// `entry` of its fragments.
struct RasterTile {
  int left = 0, top = 0, columns = 0, rows = 0;  ///< pixels
  std::vector<std::uint32_t> triangles;          ///< block by block, then the clipped ones
  std::vector<std::uint32_t> covered;            ///< [triangles] how many pixels
  std::vector<std::uint32_t> first;              ///< [blocks + 1] block → its first entry
};

/// Rasterizes a triangle within a tile; returns the number of pixels covered.
std::uint32_t draw(const ScreenTriangle& s, const RasterTile& tile, std::uint32_t entry,
                   ABuffer& buffer);
std::uint32_t draw(const ClippedTriangle& s, const RasterTile& tile, std::uint32_t entry,
                   ABuffer& buffer);

}  // namespace mr::kit
