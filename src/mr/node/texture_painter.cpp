#include "mr/node/texture_painter.h"

#include <memory>
#include <utility>

#include "mr/atlas/occluders.h"
#include "mr/atlas/view_blend.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"

namespace mr::node {
namespace {

using Source = atlas::ViewBlend::Source;

/// A source whose colours are corrected as the corrections say.
Source source_of(const View& view, const ImageRgb& picture,
                 const atlas::ColorCorrections& corrections) {
  Source out;
  out.view = &view, out.picture = &picture;
  if (const auto found = corrections.find(view.id); found != corrections.end())
    out.field = found->second.field, out.log_exposure = found->second.log_exposure;
  return out;
}

/// The nearer depth of two depth maps of one view; `a` may be null.
ImageDepth nearer(const ImageDepth* a, const ImageDepth& b) {
  if (!a) return b;
  ImageDepth out = *a;
  for (std::size_t p = 0; p < out.data.size(); ++p)
    if (const float d = b.data[p]; d > 0 && (out.data[p] <= 0 || d < out.data[p])) out.data[p] = d;
  return out;
}

/// The pictures of sources, by stream. `surfaces`: [sources] depth of what each textures; null:
/// of a view that is not blended.
atlas::Pictures paint(const std::vector<Source>& sources, const TexturePainter::Used& used,
                      const std::vector<const ImageDepth*>& surfaces,
                      const atlas::BlendConfig& config) {
  const atlas::ViewBlend blend(sources, config);
  atlas::Pictures out;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const auto mask = used.find(sources[i].view->id);
    out[sources[i].view->stream] = std::make_shared<const ImageRgb>(
        blend.picture(i, mask == used.end() ? nullptr : &mask->second, surfaces[i]));
  }
  return out;
}

}  // namespace

/// Draws the still surface from all pinhole views where it or a view is another.
void TexturePainter::draw_still_depths(const Mesh& still, const std::vector<View>& views) {
  const bool same = still.positions == still_.positions && still.triangles == still_.triangles;
  if (!same) still_ = still;
  std::map<ViewId, StillDepth> before = std::exchange(still_depths_, {});
  std::vector<StillDepth*> changed;
  for (const View& view : views) {
    if (view.kind != View::Kind::pinhole) continue;
    StillDepth& still_depth = still_depths_[view.id];
    const auto known = before.find(view.id);
    if (same && known != before.end() && known->second.view == view)
      still_depth = std::move(known->second);
    else
      still_depth.view = view, changed.push_back(&still_depth);
  }
  parallel_for(changed.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const View& view = changed[i]->view;
      changed[i]->depth =
          kit::rasterize_depth(still_, atlas::depth_camera(view.camera()), view.T_world_camera);
    }
  });
}

atlas::Pictures TexturePainter::live(const Live& from, const Used& used, const Mesh& moving,
                                     const Mesh* still, const RootColors& colors) {
  if (moving.empty()) return from.pictures;
  if (still) draw_still_depths(*still, from.views);
  const atlas::ColorCorrections corrections = colors.live();
  std::vector<Source> sources;
  for (const View& view : from.views) {
    const auto picture = from.pictures.find(view.stream);
    if (picture == from.pictures.end() || !picture->second) continue;
    Source& source = sources.emplace_back(source_of(view, *picture->second, corrections));
    if (const auto tiles = from.seeing.find(view.id); tiles != from.seeing.end())
      source.valid = &tiles->second;
  }
  std::vector<ImageDepth> depths(sources.size()), nearest(sources.size());
  parallel_for(sources.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const View& view = *sources[i].view;
      if (view.kind != View::Kind::pinhole) continue;
      const auto behind = still ? still_depths_.find(view.id) : still_depths_.end();
      depths[i] =
          kit::rasterize_depth(moving, atlas::depth_camera(view.camera()), view.T_world_camera);
      nearest[i] =
          nearer(behind == still_depths_.end() ? nullptr : &behind->second.depth, depths[i]);
    }
  });
  std::vector<const ImageDepth*> surfaces(sources.size());
  for (std::size_t i = 0; i < sources.size(); ++i)
    if (!depths[i].empty()) sources[i].nearest = &nearest[i], surfaces[i] = &depths[i];
  return paint(sources, used, surfaces, colors.blending());
}

atlas::Pictures TexturePainter::plates(const std::vector<View>& views,
                                       const RootColors::Plates& plates, const Used& used,
                                       const Mesh& still, const RootColors& colors) {
  draw_still_depths(still, views);
  const atlas::ColorCorrections corrections = colors.plates();
  std::vector<Source> sources;
  std::vector<const ImageDepth*> surfaces;
  for (const View& view : views) {
    const auto plate = plates.find(view.id);
    if (plate == plates.end() || plate->second.picture().empty()) continue;
    Source& source = sources.emplace_back(source_of(view, plate->second.picture(), corrections));
    source.valid = &plate->second.valid();
    if (const auto depth = still_depths_.find(view.id); depth != still_depths_.end())
      source.nearest = &depth->second.depth;
    surfaces.push_back(source.nearest);
  }
  return paint(sources, used, surfaces, colors.blending());
}

}  // namespace mr::node
