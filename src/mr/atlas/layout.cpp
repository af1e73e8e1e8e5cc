#include "mr/atlas/layout.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

namespace mr::atlas {
namespace {

constexpr int kMacroblock = 16;

int up_to_macroblock(int pixels) { return (pixels + kMacroblock - 1) / kMacroblock * kMacroblock; }

/// Places tiles in rows of at most `width` pixels, in order. Returns the size of the picture.
std::pair<int, int> place(std::vector<View>& views, double scale, int width) {
  int x = 0, y = 0, row_height = 0, used_width = 0;
  for (View& v : views) {
    const auto scaled = [&](int size) {
      return std::max(2, static_cast<int>(std::lround(size * scale)) / 2 * 2);
    };
    const int w = scaled(v.image_rect.width), h = scaled(v.image_rect.height);
    if (x > 0 && x + w > width) x = 0, y += row_height, row_height = 0;
    v.atlas_rect = {x, y, w, h};
    x += up_to_macroblock(w);
    row_height = std::max(row_height, up_to_macroblock(h));
    used_width = std::max(used_width, x);
  }
  return {used_width, y + row_height};
}

/// Chooses the row width, a multiple of the widest tile, that gives the smallest picture.
std::pair<int, int> place_compactly(std::vector<View>& views, double scale,
                                    const AtlasConfig& atlas) {
  const int limit_w = atlas.width / kMacroblock * kMacroblock,
            limit_h = atlas.height / kMacroblock * kMacroblock;
  int widest = kMacroblock;
  for (const View& v : views)
    widest = std::max(widest,
                      up_to_macroblock(static_cast<int>(std::lround(v.image_rect.width * scale))));
  int best_width = 0;
  long best_area = -1;
  for (int width = widest; width <= limit_w; width += widest) {
    const auto [w, h] = place(views, scale, width);
    const long area = static_cast<long>(w) * h;
    if (w > limit_w || h > limit_h || (best_area >= 0 && area >= best_area)) continue;
    best_width = width, best_area = area;
  }
  if (best_area < 0) return {0, 0};
  return place(views, scale, best_width);
}

}  // namespace

Result<Layout> make_layout(const std::vector<View>& views, const AtlasConfig& atlas, double scale,
                           std::uint32_t layout_id) {
  Layout layout;
  layout.views = views;
  if (views.empty()) return layout;
  constexpr double kLeastScale = 1e-4;  // tiles have their minimum size by then
  for (double s = scale; s > kLeastScale && layout.width == 0; s *= 0.95)
    std::tie(layout.width, layout.height) = place_compactly(layout.views, s, atlas);
  if (layout.width == 0)
    return Error{Error::Cause::too_large,
                 std::to_string(views.size()) + " views do not fit into an atlas of " +
                     std::to_string(atlas.width) + "x" + std::to_string(atlas.height)};
  for (View& v : layout.views) {
    v.stream = {};
    v.layout = layout_id;
  }
  return layout;
}

}  // namespace mr::atlas
