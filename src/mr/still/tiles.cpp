#include "mr/still/tiles.h"

#include <algorithm>
#include <cmath>

namespace mr::still {
namespace {

TileMask tiles_of(int width, int height, int tile_px, std::uint8_t fill) {
  const int columns = (width + tile_px - 1) / tile_px, rows = (height + tile_px - 1) / tile_px;
  return {tile_px, columns, rows,
          std::vector<std::uint8_t>(static_cast<std::size_t>(columns) * rows, fill)};
}

}  // namespace

TileMask confirmed_tiles(const ImageMask& confirmed, const ImageMask& moving) {
  TileMask out = tiles_of(confirmed.width, confirmed.height, kDepthTile_px, 0);
  for (int row = 0; row < out.rows; ++row)
    for (int column = 0; column < out.columns; ++column) {
      int yes = 0, all = 0;
      bool moves = false;
      for (int y = row * kDepthTile_px; y < std::min((row + 1) * kDepthTile_px, confirmed.height);
           ++y)
        for (int x = column * kDepthTile_px;
             x < std::min((column + 1) * kDepthTile_px, confirmed.width); ++x)
          ++all, yes += *confirmed.at(x, y), moves |= *moving.at(x, y) != 0;
      out.tiles[static_cast<std::size_t>(row) * out.columns + column] = !moves && 2 * yes > all;
    }
  return out;
}

TileMask unoccluded_tiles(const ImageDepth& depth, const ImageMask& moving,
                          const Camera& depth_camera, const Camera& color_camera,
                          const Pose& T_color_depth) {
  constexpr int kStep_px = 2;
  TileMask out = tiles_of(color_camera.width, color_camera.height, kColorTile_px, 1);
  const auto hide = [&](int column, int row) {
    for (int y = std::max(row - 1, 0); y <= std::min(row + 1, out.rows - 1); ++y)
      for (int x = std::max(column - 1, 0); x <= std::min(column + 1, out.columns - 1); ++x)
        out.tiles[static_cast<std::size_t>(y) * out.columns + x] = 0;
  };
  for (int y = 0; y < depth.height; y += kStep_px)
    for (int x = 0; x < depth.width; x += kStep_px) {
      const float z = *depth.at(x, y);
      if (!*moving.at(x, y) || !(z > 0)) continue;
      const Vec3d ray = unproject(depth_camera, {double(x), double(y)});
      const auto pixel = project(color_camera, T_color_depth * (ray * double(z)));
      if (!pixel) continue;
      const int u = static_cast<int>(std::lround(std::clamp(pixel->x, -1e6, 1e6))),
                v = static_cast<int>(std::lround(std::clamp(pixel->y, -1e6, 1e6)));
      if (u >= 0 && v >= 0 && u < color_camera.width && v < color_camera.height)
        hide(u / kColorTile_px, v / kColorTile_px);
    }
  return out;
}

std::vector<Rect> covering_rectangles(const ImageMask& mask, int around_px) {
  constexpr int kStrip_px = 32;
  const int strips = (mask.width + kStrip_px - 1) / kStrip_px;
  std::vector<int> top(static_cast<std::size_t>(strips), mask.height), bottom(top.size(), -1);
  for (int y = 0; y < mask.height; ++y) {
    const std::uint8_t* const row = mask.row(y);
    for (int s = 0; s < strips; ++s) {
      const int end = std::min((s + 1) * kStrip_px, mask.width);
      if (std::find(row + s * kStrip_px, row + end, 1) == row + end) continue;
      top[s] = std::min(top[s], y), bottom[s] = y;
    }
  }
  std::vector<Rect> out;
  for (int s = 0; s < strips; ++s) {
    if (bottom[s] < 0) continue;
    const int first = s;
    int y0 = mask.height, y1 = 0;
    for (; s < strips && bottom[s] >= 0; ++s)
      y0 = std::min(y0, top[s]), y1 = std::max(y1, bottom[s] + 1);
    const int x0 = std::max(first * kStrip_px - around_px, 0),
              x1 = std::min(s * kStrip_px + around_px, mask.width);
    y0 = std::max(y0 - around_px, 0), y1 = std::min(y1 + around_px, mask.height);
    out.push_back({x0, y0, x1 - x0, y1 - y0});
  }
  return out;
}

}  // namespace mr::still
