#include "mr/eval/outline.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/eval/draw_scene.h"
#include "mr/eval/geometry_error.h"
#include "mr/eval/reference.h"
#include "mr/eval/sensor_coverage.h"
#include "mr/eval/viewpoints.h"
#include "mr/kit/image_io.h"
#include "mr/kit/raster.h"
#include "mr/kit/raycast.h"
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

OutlineDistance one_way(const ImageMask& from, const ImageMask& to, const ImageMask& left_out) {
  std::vector<OutlineDistance> rows(from.height);
  parallel_for(rows.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) {
      const int y = static_cast<int>(r);
      for (int x = 0; x < from.width; ++x)
        if (*from.at(x, y) && (left_out.empty() || !*left_out.at(x, y)))
          rows[r].sum_px += nearest_px(to, x, y), ++rows[r].pixels;
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

/// The people of the truth from one viewpoint.
struct PeopleView {
  render::Viewpoint view;
  ImageDepth room;   ///< without them
  ImageMask people;  ///< [H, W]
  ImageMask clear;   ///< people that are clear_of() the room
  ImageMask unseen;  ///< people that no sensor sees
};

/// The truth of a capture: its room, and its people from each viewpoint that shows some.
struct TruePeople {
  kit::RayScene room;
  std::vector<PeopleView> views;
};

/// The marked pixels whose points are at least kOutlineStep_m from the room, whichever way.
ImageMask clear_of(const kit::RayScene& room, const ImageMask& mask, const ImageDepth& depth,
                   const render::Viewpoint& view) {
  ImageMask out = mask;
  parallel_for(mask.height, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r)
      for (int x = 0, y = static_cast<int>(r); x < mask.width; ++x) {
        if (!*mask.at(x, y)) continue;
        const Vec3d ray = unproject(view.camera, {double(x), double(y)});
        const Vec3d p = view.T_world_camera * (ray * double{*depth.at(x, y)});
        *out.at(x, y) = !room.nearest(vec_cast<float>(p), static_cast<float>(kOutlineStep_m));
      }
  });
  return out;
}

/// Finds which people's pixels no sensor sees: all views at once, on one surface.
class UnseenPeople {
 public:
  explicit UnseenPeople(const Mesh& truth) : truth_(truth) {}

  void add(PeopleView& view, const kit::Raster& drawn) {
    const Camera& camera = view.view.camera;
    view.unseen = ImageMask(camera.width, camera.height);
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        if (!*view.people.at(x, y)) continue;
        const Vec3d ray = unproject(camera, {double(x), double(y)});
        const Vec3d p = view.view.T_world_camera * (ray * double{*drawn.depth.at(x, y)});
        const std::uint32_t t = *drawn.triangle.at(x, y);
        samples_.push_back({vec_cast<float>(p), normalized(truth_.area_normal(t)), t});
      }
  }
  /// In the order in which the views were added.
  void mark(std::vector<PeopleView>& views, const Scene& scene) const {
    const auto seen = seen_samples(truth_, samples_, sensor_frustums(scene), scene.voxel_m);
    std::size_t next = 0;
    for (PeopleView& view : views)
      for (std::size_t i = 0; i < view.people.data.size(); ++i)
        if (view.people.data[i]) view.unseen.data[i] = !seen[next++];
  }

 private:
  const Mesh& truth_;
  std::vector<SurfaceSample> samples_;
};

TruePeople true_people(const Scene& scene, const RigConfig& rig, int capture,
                       const std::vector<render::Viewpoint>& views) {
  synth::Truth truth(rig, scene.fps);
  const Mesh room = truth.room();
  const Mesh all = truth.surface(static_cast<std::uint64_t>(truth_frame(scene, capture))).mesh;
  UnseenPeople unseen(all);
  TruePeople out{kit::RayScene(std::vector<const Mesh*>{&room}), {}};
  for (const render::Viewpoint& from : views) {
    PeopleView view{from, {}, {}, {}, {}};
    view.view.camera = picture_camera(kOutlineWidth, kOutlineHeight, kOutlineFov_deg);
    view.room = kit::rasterize_depth(room, view.view.camera, from.T_world_camera);
    const kit::Raster drawn = kit::rasterize(all, view.view.camera, from.T_world_camera);
    view.people = people_mask(drawn.depth, view.room);
    if (std::ranges::count(view.people.data, 1) == 0) continue;
    view.clear = clear_of(out.room, view.people, drawn.depth, view.view);
    unseen.add(view, drawn);
    out.views.push_back(std::move(view));
  }
  unseen.mark(out.views, scene);
  return out;
}

double mean_px(const OutlineDistance& sum) { return sum.sum_px / static_cast<double>(sum.pixels); }

/// The picture with the truth's outline in green, the drawn one in red, both in yellow.
ImageRgb with_outlines(ImageRgb picture, const ImageMask& wanted, const ImageMask& found) {
  for (std::size_t i = 0; i < wanted.data.size(); ++i) {
    if (!wanted.data[i] && !found.data[i]) continue;
    picture.data[3 * i] = found.data[i] ? 255 : 0,
                     picture.data[3 * i + 1] = wanted.data[i] ? 255 : 0;
    picture.data[3 * i + 2] = 0;
  }
  return picture;
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

OutlineDistance outline_distance(const ImageMask& a, const ImageMask& b,
                                 const ImageMask& left_out) {
  OutlineDistance out = one_way(a, b, left_out);
  out.add(one_way(b, a, left_out));
  return out;
}

Result<std::optional<OutlineError>> outline_error(const Scene& scene, const DecodedScene& shown,
                                                  int capture,
                                                  const std::vector<render::Viewpoint>& views,
                                                  const std::filesystem::path& pictures) {
  const RigConfig* rig = known_rig(scene);
  if (!rig || rig->people == 0) return std::optional<OutlineError>{};
  auto renderer = render::Renderer::create();
  if (!renderer) return renderer.error();
  OutlineDistance all, seen;
  const TruePeople truth = true_people(scene, *rig, capture, views);
  for (const PeopleView& from : truth.views) {
    auto drawn = draw_scene(*renderer, shown, from.view);
    if (!drawn) return drawn.error();
    const auto depth = renderer->depth();
    if (!depth) return depth.error();
    const ImageMask region = grown(from.people, kOutlineReach_px);
    const ImageMask wanted = outline_of(from.people, region);
    const ImageMask people = people_mask(*depth, from.room);
    const ImageMask found = outline_of(people, region);
    all.add(outline_distance(wanted, found));
    seen.add(outline_distance(outline_of(from.clear, region),
                              outline_of(clear_of(truth.room, people, *depth, from.view), region),
                              grown(from.unseen, kUnseenReach_px)));
    if (pictures.empty()) continue;
    const ImageRgb marked = with_outlines(std::move(drawn->color), wanted, found);
    if (const Status ok = kit::write_png(pictures / (from.view.name + ".png"), marked); !ok)
      return ok.error();
  }
  if (all.pixels == 0) return std::optional<OutlineError>{};
  return std::optional(
      OutlineError{mean_px(all), seen.pixels > 0 ? std::optional(mean_px(seen)) : std::nullopt});
}

}  // namespace mr::eval
