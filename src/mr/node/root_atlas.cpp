#include "mr/node/root_atlas.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/atlas/burn.h"
#include "mr/atlas/compose.h"
#include "mr/atlas/labels.h"
#include "mr/core/parallel.h"
#include "mr/node/sensor_node.h"

namespace mr::node {
namespace {

atlas::Pictures pictures_of(const Gathered& gathered) {
  atlas::Pictures out;
  for (const DecodedScene& scene : gathered.scenes)
    out.insert(scene.textures.begin(), scene.textures.end());
  return out;
}

/// Which blocks of a view its own sensor's depth picture sees all of, near and far.
TileMask seen_by_depth(const View& view, const SourceInfo& source, const TileMask& blocks) {
  TileMask out = blocks;
  const Camera camera = view.camera();
  const Pose T_depth_color = source.T_world_depth.inverse() * view.T_world_camera;
  const auto sees = [&](Vec2d pixel, double depth_m) {
    const auto p = project(source.depth_camera, T_depth_color * (unproject(camera, pixel) * depth_m));
    return p && p->x >= 0 && p->y >= 0 && p->x <= source.depth_camera.width - 1 &&
           p->y <= source.depth_camera.height - 1;
  };
  for (int row = 0; row < out.rows; ++row)
    for (int column = 0; column < out.columns; ++column) {
      const Vec2d middle{(column + 0.5) * out.tile_px, (row + 0.5) * out.tile_px};
      out.tiles[static_cast<std::size_t>(row) * out.columns + column] =
          sees(middle, 1) && sees(middle, 2) && sees(middle, 8);
    }
  return out;
}

/// Takes the blocks from a mask that a mesh falls into, and those around them, but for those that
/// are `seen`.
void hide(const Mesh& mesh, const View& view, const TileMask& seen, TileMask& unhidden) {
  const Camera camera = view.camera();
  const Pose T_camera_world = view.T_world_camera.inverse();
  std::vector<Vec2f> pixel(mesh.positions.size());
  constexpr float kNowhere = -1e9f;
  for (std::size_t v = 0; v < pixel.size(); ++v) {
    const auto p = project(camera, T_camera_world * vec_cast<double>(mesh.positions[v]));
    pixel[v] = p ? Vec2f{static_cast<float>(p->x), static_cast<float>(p->y)}
                 : Vec2f{kNowhere, kNowhere};
  }
  const auto tile = [&](float p, int last) {
    return static_cast<int>(std::clamp(p / static_cast<float>(unhidden.tile_px), -2.0f,
                                       static_cast<float>(last) + 2.0f));
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    const auto [left, right] = std::minmax({pixel[a].x, pixel[b].x, pixel[c].x});
    const auto [top, bottom] = std::minmax({pixel[a].y, pixel[b].y, pixel[c].y});
    // Behind the camera, or across the seam of a panorama: what is beside it will do.
    if (left == kNowhere || right - left > 0.5f * static_cast<float>(view.width)) continue;
    const int x0 = std::max(tile(left, unhidden.columns) - 1, 0),
              x1 = std::min(tile(right, unhidden.columns) + 1, unhidden.columns - 1),
              y1 = std::min(tile(bottom, unhidden.rows) + 1, unhidden.rows - 1);
    for (int y = std::max(tile(top, unhidden.rows) - 1, 0); y <= y1; ++y)
      for (int x = x0; x <= x1; ++x)
        if (!seen.at(x, y)) unhidden.tiles[static_cast<std::size_t>(y) * unhidden.columns + x] = 0;
  }
}

}  // namespace

RootAtlas::RootAtlas(const Scene& scene)
    : scene_(&scene), live_(scene, kLiveStream), plate_(scene, kPlateStream) {}

void RootAtlas::answer(const codec::Request& request) {
  if (request.wants_key_frame(kLiveStream)) live_.ask_key_frame();
  if (request.wants_key_frame(kPlateStream)) plate_.ask_key_frame();
}

void RootAtlas::update_plates(const Tick& tick, const Mesh& moving) {
  const atlas::Pictures pictures = pictures_of(tick.gathered);
  struct Work {
    atlas::Plate* plate;
    const View* view;
    const SourceInfo* source;
    const ImageRgb* picture;
  };
  std::vector<Work> all;
  for (const SourceInfo& source : tick.sources) {
    const auto view = std::ranges::find(tick.views, source.sensor, &View::id);
    if (view == tick.views.end() || source.confirmed_color.empty()) continue;
    const auto picture = pictures.find(view->stream);
    if (picture == pictures.end() || !picture->second) continue;
    all.push_back({&plates_[view->id], &*view, &source, picture->second.get()});
  }
  std::vector<std::uint8_t> changed(all.size());
  parallel_for(all.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto& [plate, view, source, picture] = all[i];
      TileMask unhidden = source->confirmed_color;
      hide(moving, *view, seen_by_depth(*view, *source, unhidden), unhidden);
      changed[i] = plate->update(*picture, unhidden) && plate->changed_blocks() > 0;
    }
  });
  plates_changed_ |= std::ranges::find(changed, 1) != changed.end();
}

void RootAtlas::recall(Memory memory) {
  plates_ = std::move(memory.plates), balance_ = std::move(memory.balance);
  plates_changed_ = true;
}

std::map<ViewId, TileMask> RootAtlas::valid() const {
  std::map<ViewId, TileMask> out;
  for (const auto& [view, plate] : plates_) out[view] = plate.valid();
  return out;
}

std::size_t RootAtlas::valid_blocks() const {
  std::size_t out = 0;
  for (const auto& [view, plate] : plates_)
    out += static_cast<std::size_t>(std::ranges::count(plate.valid().tiles, 1));
  return out;
}

/// Tiles for the views; another arrangement is another layout.
Status RootAtlas::arrange(const std::vector<View>& views) {
  const std::uint32_t current = layout_.views.empty() ? 0 : layout_.views.front().layout;
  auto made = atlas::make_layout(views, scene_->atlas, scene_->coding.texture_scale, current);
  if (!made) return made.error();
  const auto same_tile = [](const View& a, const View& b) {
    return a.id == b.id && a.atlas_rect == b.atlas_rect;
  };
  if (!std::ranges::equal(made->views, layout_.views, same_tile))
    for (View& view : made->views) view.layout = current + 1;
  layout_ = *std::move(made);
  return {};
}

RootAtlas::Used RootAtlas::used_pixels(const Tick& tick, const Mesh& shown, float error_m) const {
  std::vector<ImageMask> masks(tick.views.size());
  parallel_for(masks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const View& view = tick.views[i];
      const double margin = atlas::margin_px(view, texturing_error_m(*scene_, error_m), 1.0);
      masks[i] = atlas::used_pixels(shown, view, static_cast<int>(std::ceil(margin)));
    }
  });
  Used out;
  for (std::size_t i = 0; i < masks.size(); ++i) out[tick.views[i].id] = std::move(masks[i]);
  return out;
}

/// Where there is a plate, all that does not move repeats it; elsewhere pixels of no use are black.
ImageRgb RootAtlas::draw_live(const Tick& tick, const Children& children,
                              const atlas::Pictures& pictures, const Used& used) const {
  atlas::Pictures frozen = pictures;
  Used masks = used;
  std::vector<std::pair<const View*, std::shared_ptr<ImageRgb>>> made;
  for (const View& view : tick.views) {
    const auto plate = plates_.find(view.id);
    const auto picture = pictures.find(view.stream);
    if (plate == plates_.end() || picture == pictures.end() || !used.contains(view.id)) continue;
    made.emplace_back(&view, std::make_shared<ImageRgb>(*picture->second));
    frozen[view.stream] = made.back().second;
    masks.erase(view.id);
  }
  parallel_for(made.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const ViewId id = made[i].first->id;
      ImageRgb& live = *made[i].second;
      ImageMask mask = used.at(id);
      if (mask.width != live.width || mask.height != live.height) {  // padded to even
        ImageMask padded(live.width, live.height);
        for (int y = 0; y < mask.height; ++y)
          std::copy_n(mask.row(y), mask.width, padded.row(y));
        mask = std::move(padded);
      }
      atlas::freeze_outside(live, plates_.at(id).picture(), mask);
    }
  });
  return atlas::compose_atlas(layout_, children, frozen, masks, scene_->atlas.mask,
                              balance_.gains());
}

/// Codes a picture unless it is the last one.
Status RootAtlas::add_unit(TextureStream& stream, ImageRgb picture, ImageRgb& last,
                           Packet& packet) {
  if (picture == last && !stream.key_frame_asked()) return {};
  auto unit = stream.encode(picture, packet.plan.texture_qp, layout_.views.front().layout);
  if (!unit) return unit.error();
  last = std::move(picture);
  packet.textures.push_back(*std::move(unit));
  return {};
}

Status RootAtlas::compose(const Tick& tick, const Mesh& moving, const Mesh* still, float error_m,
                          Packet& packet) {
  if (const Status arranged = arrange(tick.views); !arranged) return arranged;
  packet.views.clear();
  for (const View& live : layout_.views) {
    packet.views.push_back(live);
    const auto plate = plates_.find(live.id);
    if (!still || plate == plates_.end()) continue;
    packet.views.push_back(live);
    packet.views.back().layer = Layer::still, packet.views.back().stream = kPlateStream;
    packet.views.back().gain = plate->second.gain();
  }
  Children children;
  for (const View& view : tick.views) children[view.id] = view;
  const atlas::Pictures pictures = pictures_of(tick.gathered);
  Used used;
  if (scene_->atlas.mask || !plates_.empty()) used = used_pixels(tick, moving, error_m);
  if (scene_->merge.color_gain) balance_.update(still ? *still : moving, tick.views, pictures);
  ImageRgb picture = draw_live(tick, children, pictures, used);
  if (scene_->atlas.burn_sequence) atlas::burn_number(picture, packet.sequence);
  if (const Status coded = add_unit(live_, std::move(picture), last_live_, packet); !coded)
    return coded;
  return still && !plates_.empty() ? add_plates(tick, children, packet) : Status{};
}

/// The atlas of plates, where it is another than before.
Status RootAtlas::add_plates(const Tick& tick, const Children& children, Packet& packet) {
  const std::uint32_t layout = layout_.views.front().layout;
  const bool same = !plates_changed_ && plate_gains_ == balance_.gains() && plate_layout_ == layout;
  if (same && !plate_.key_frame_asked()) return {};
  atlas::Pictures plates;
  for (const View& view : tick.views)
    if (const auto plate = plates_.find(view.id); plate != plates_.end())
      plates[view.stream] = std::make_shared<const ImageRgb>(plate->second.picture());
  plates_changed_ = false, plate_gains_ = balance_.gains(), plate_layout_ = layout;
  return add_unit(plate_,
                  atlas::compose_atlas(layout_, children, plates, {}, false, plate_gains_),
                  last_plate_, packet);
}

}  // namespace mr::node
