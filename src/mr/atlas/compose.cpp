#include "mr/atlas/compose.h"

#include <algorithm>
#include <cmath>

#include "mr/core/parallel.h"
#include "mr/kit/raster.h"

namespace mr::atlas {
namespace {

/// Grows a mask by r pixels in all eight directions.
ImageMask grown(const ImageMask& mask, int r) {
  ImageMask rows(mask.width, mask.height), out(mask.width, mask.height);
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x)
      if (*mask.at(x, y)) {
        const int first = std::max(0, x - r), last = std::min(mask.width - 1, x + r);
        std::fill(rows.at(first, y), rows.at(last, y) + 1, 1);
      }
  for (int y = 0; y < mask.height; ++y)
    for (int k = std::max(0, y - r); k <= std::min(mask.height - 1, y + r); ++k)
      for (int x = 0; x < mask.width; ++x) *out.at(x, y) |= *rows.at(x, k);
  return out;
}

void draw_tile(const View& tile, const View& child, const ImageRgb& picture, const ImageMask* used,
               ImageRgb& atlas) {
  const Rect &to = tile.atlas_rect, &crop = tile.image_rect;
  const double sx = static_cast<double>(crop.width) / to.width,
               sy = static_cast<double>(crop.height) / to.height;
  parallel_for(to.height, 16, [&](std::size_t begin, std::size_t end) {
    for (int j = static_cast<int>(begin); j < static_cast<int>(end); ++j)
      for (int i = 0; i < to.width; ++i) {
        // Tile pixel → camera pixel → child's picture, all with centres at integers.
        const Vec2d p{(i + 0.5) * sx + crop.x - 0.5, (j + 0.5) * sy + crop.y - 0.5};
        if (used && !*used->at(std::clamp(static_cast<int>(std::lround(p.x)), 0, used->width - 1),
                               std::clamp(static_cast<int>(std::lround(p.y)), 0, used->height - 1)))
          continue;
        const Vec2d uv = atlas_uv(child, p, picture.width, picture.height);
        std::ranges::copy(sample_bilinear(picture, child.atlas_rect, uv.x * picture.width - 0.5,
                                          uv.y * picture.height - 0.5),
                          atlas.at(to.x + i, to.y + j));
      }
  });
}

}  // namespace

ImageMask used_pixels(const Mesh& mesh, const View& view, int margin_px) {
  ImageMask mask(view.width, view.height);
  if (view.kind != View::Kind::pinhole) {
    std::fill(mask.data.begin(), mask.data.end(), 1);
    return mask;
  }
  const Camera camera = view.camera();
  const Pose T_camera_world = view.T_world_camera.inverse();
  for (const ViewRun& run : mesh.runs) {
    if (run.view != view.id) continue;
    for (std::uint32_t t = run.first; t < run.first + run.count; ++t) {
      const auto corner = [&](int i) {
        return T_camera_world * vec_cast<double>(mesh.corner(t, i));
      };
      const std::array<Vec3d, 3> corners = {corner(0), corner(1), corner(2)};
      kit::scan_polygon(kit::clip_to_screen(camera, corners), camera.width, 0, camera.height,
                        [&](int x, int y, double) { *mask.at(x, y) = 1; });
      for (const Vec3d& c : corners) {  // slivers hit no pixel centre
        const kit::ScreenPoint s = kit::to_screen(camera, c);
        const int x = static_cast<int>(std::lround(s.u)), y = static_cast<int>(std::lround(s.v));
        if (c.z > kit::kNearPlane_m && mask.contains(x, y)) *mask.at(x, y) = 1;
      }
    }
  }
  return grown(mask, margin_px);
}

ImageRgb compose_atlas(const Layout& layout, const std::map<ViewId, View>& children,
                       const std::map<std::uint32_t, std::shared_ptr<const ImageRgb>>& pictures,
                       const std::map<ViewId, ImageMask>& used, bool mask) {
  ImageRgb atlas(layout.width, layout.height);
  for (const View& tile : layout.views) {
    const auto child = children.find(tile.id);
    if (child == children.end()) continue;
    const auto picture = pictures.find(child->second.stream);
    if (picture == pictures.end() || !picture->second) continue;
    const auto found = used.find(tile.id);
    draw_tile(tile, child->second, *picture->second,
              mask && found != used.end() ? &found->second : nullptr, atlas);
  }
  return atlas;
}

}  // namespace mr::atlas
