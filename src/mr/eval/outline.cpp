#include "mr/eval/outline.h"

#include <algorithm>
#include <cmath>

#include "mr/core/parallel.h"
#include "mr/eval/draw_scene.h"
#include "mr/eval/reference.h"
#include "mr/eval/sensor_coverage.h"
#include "mr/eval/viewpoints.h"
#include "mr/kit/raster.h"
#include "mr/synth/truth.h"

namespace mr::eval {
namespace {

constexpr int kOutlineWidth = 1280, kOutlineHeight = 720;
constexpr double kOutlineFov_deg = 60;

/// From a pixel to the nearest marked one, at most kOutlineMost_px.
double nearest_px(const ImageMask& marked, int x, int y) {
  constexpr int kMost = kOutlineMost_px;
  int best = kMost * kMost;
  for (int dy = -kMost; dy <= kMost; ++dy) {
    const int row = y + dy;
    if (row < 0 || row >= marked.height || dy * dy >= best) continue;
    const int first = std::max(0, x - kMost), last = std::min(marked.width - 1, x + kMost);
    for (int column = first; column <= last; ++column)
      if (*marked.at(column, row)) best = std::min(best, dy * dy + (column - x) * (column - x));
  }
  return std::sqrt(best);
}

OutlineDistance one_way(const ImageMask& from, const ImageMask& to) {
  std::vector<OutlineDistance> rows(from.height);
  parallel_for(rows.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) {
      const int y = static_cast<int>(r);
      for (int x = 0; x < from.width; ++x)
        if (*from.at(x, y)) rows[r].sum_px += nearest_px(to, x, y), ++rows[r].pixels;
    }
  });
  OutlineDistance out;
  for (const OutlineDistance& row : rows) out.add(row);
  return out;
}

/// Marks what lies within `reach` before or behind along the rows.
ImageMask grown_along_rows(const ImageMask& mask, int reach) {
  ImageMask out(mask.width, mask.height);
  for (int y = 0; y < mask.height; ++y) {
    int open_until = -1;  // marked up to here
    for (int x = 0; x < mask.width; ++x) {
      if (*mask.at(x, y)) {
        std::fill(out.at(std::max(0, x - reach), y), out.at(x, y), std::uint8_t{1});
        open_until = x + reach;
      }
      if (x <= open_until) *out.at(x, y) = 1;
    }
  }
  return out;
}

ImageMask transposed(const ImageMask& mask) {
  ImageMask out(mask.height, mask.width);
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) *out.at(y, x) = *mask.at(x, y);
  return out;
}

}  // namespace

ImageMask people_mask(const ImageDepth& depth, const ImageDepth& room) {
  ImageMask out(depth.width, depth.height);
  for (std::size_t i = 0; i < out.data.size(); ++i) {
    const double z = depth.data[i], behind = room.data[i];
    out.data[i] = z > 0 && (behind <= 0 || z <= behind - kOutlineStep_m);
  }
  return out;
}

ImageMask grown(const ImageMask& mask, int reach_px) {
  return transposed(grown_along_rows(transposed(grown_along_rows(mask, reach_px)), reach_px));
}

ImageMask outline_of(const ImageMask& mask, const ImageMask& region) {
  ImageMask out(mask.width, mask.height);
  const auto is_outside = [&](int x, int y) {
    return mask.contains(x, y) && *region.at(x, y) && !*mask.at(x, y);
  };
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x)
      *out.at(x, y) = *mask.at(x, y) && *region.at(x, y) &&
                      (is_outside(x - 1, y) || is_outside(x + 1, y) || is_outside(x, y - 1) ||
                       is_outside(x, y + 1));
  return out;
}

OutlineDistance outline_distance(const ImageMask& a, const ImageMask& b) {
  OutlineDistance out = one_way(a, b);
  out.add(one_way(b, a));
  return out;
}

Result<std::optional<double>> outline_px(const Scene& scene, const DecodedScene& shown, int capture,
                                         const std::vector<render::Viewpoint>& views) {
  const RigConfig* rig = known_rig(scene);
  if (!rig || rig->people == 0) return std::optional<double>{};
  synth::Truth truth(*rig, scene.fps);
  const Mesh room = truth.room();
  const Mesh all = truth.surface(static_cast<std::uint64_t>(truth_frame(scene, capture))).mesh;
  auto renderer = render::Renderer::create();
  if (!renderer) return renderer.error();
  OutlineDistance sum;
  for (render::Viewpoint view : views) {
    view.camera = picture_camera(kOutlineWidth, kOutlineHeight, kOutlineFov_deg);
    const ImageDepth behind = kit::rasterize_depth(room, view.camera, view.T_world_camera);
    const ImageMask people =
        people_mask(kit::rasterize_depth(all, view.camera, view.T_world_camera), behind);
    if (std::ranges::count(people.data, 1) == 0) continue;
    if (const auto drawn = draw_scene(*renderer, shown, view); !drawn) return drawn.error();
    const auto depth = renderer->depth();
    if (!depth) return depth.error();
    const ImageMask region = grown(people, kOutlineReach_px);
    sum.add(outline_distance(outline_of(people, region),
                             outline_of(people_mask(*depth, behind), region)));
  }
  if (sum.pixels == 0) return std::optional<double>{};
  return std::optional(sum.sum_px / static_cast<double>(sum.pixels));
}

}  // namespace mr::eval
