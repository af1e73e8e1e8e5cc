#include "mr/node/root_atlas.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "mr/atlas/compose.h"
#include "mr/atlas/labels.h"
#include "mr/atlas/watermark.h"
#include "mr/codec/alpha_codec.h"
#include "mr/core/parallel.h"
#include "mr/node/layers.h"
#include "mr/node/sensor_node.h"
#include "mr/rate/setting.h"
#include "mr/sensor/blind_tiles.h"
#include "mr/still/tiles.h"

namespace mr::node {
namespace {

static_assert(still::kColorTile_px == atlas::CleanPlate::kBlock_px &&
                  sensor::BlindTiles::kTile_px == atlas::CleanPlate::kBlock_px,
              "tiles that sensors name are blocks of plates");

atlas::Pictures pictures_of(const CaptureSet& captures) {
  atlas::Pictures out;
  for (const DecodedScene& scene : captures.scenes)
    out.insert(scene.textures.begin(), scene.textures.end());
  return out;
}

/// Removes from the mask `unhidden` the blocks onto which a mesh projects, dilated by one block,
/// except blocks in `seen`.
void hide(const Mesh& mesh, const View& view, const TileMask& seen, TileMask& unhidden) {
  const Camera camera = view.camera();
  const Pose T_camera_world = view.T_world_camera.inverse();
  std::vector<Vec2f> pixel(mesh.positions.size());
  constexpr float kNowhere = -1e9f;
  for (std::size_t v = 0; v < pixel.size(); ++v) {
    const auto p = project(camera, T_camera_world * vec_cast<double>(mesh.positions[v]));
    pixel[v] =
        p ? Vec2f{static_cast<float>(p->x), static_cast<float>(p->y)} : Vec2f{kNowhere, kNowhere};
  }
  const auto tile = [&](float p, int last) {
    return static_cast<int>(std::clamp(p / static_cast<float>(unhidden.tile_px), -2.0f,
                                       static_cast<float>(last) + 2.0f));
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    const auto [left, right] = std::minmax({pixel[a].x, pixel[b].x, pixel[c].x});
    const auto [top, bottom] = std::minmax({pixel[a].y, pixel[b].y, pixel[c].y});
    // Skips triangles behind the camera or across the seam of a panorama: their neighbours' dilated
    // blocks cover them.
    if (left == kNowhere || right - left > 0.5f * static_cast<float>(view.width)) continue;
    const int x0 = std::max(tile(left, unhidden.columns) - 1, 0),
              x1 = std::min(tile(right, unhidden.columns) + 1, unhidden.columns - 1),
              y1 = std::min(tile(bottom, unhidden.rows) + 1, unhidden.rows - 1);
    for (int y = std::max(tile(top, unhidden.rows) - 1, 0); y <= y1; ++y)
      for (int x = x0; x <= x1; ++x)
        if (!seen.at(x, y)) unhidden.tiles[static_cast<std::size_t>(y) * unhidden.columns + x] = 0;
  }
}

constexpr int kUsualQp = 28;

Rect bounds_of(const ImageMask& mask) {
  int left = mask.width, top = mask.height, right = 0, bottom = 0;
  for (int y = 0; y < mask.height; ++y) {
    const std::uint8_t* const row = mask.row(y);
    const std::uint8_t* const end = row + mask.width;
    const std::uint8_t* const first = std::find(row, end, 1);
    if (first == end) continue;
    const auto last = std::find(std::reverse_iterator(end), std::reverse_iterator(first), 1);
    left = std::min(left, static_cast<int>(first - row));
    right = std::max(right, static_cast<int>(last.base() - row));
    top = std::min(top, y), bottom = y + 1;
  }
  return left < right ? Rect{left, top, right - left, bottom - top} : Rect{};
}

}  // namespace

RootAtlas::RootAtlas(const Scene& scene)
    : scene_(&scene),
      colors_(scene.merge.color_gain),
      live_(scene, kLiveStream),
      plate_(scene, kPlateStream, false) {}

void RootAtlas::answer(const codec::Control& request) {
  if (request.wants_key_frame(kLiveStream)) live_.ask_key_frame();
  if (request.wants_key_frame(kPlateStream)) plate_.ask_key_frame();
}

/// Cached until one of the cameras moves.
const TileMask& RootAtlas::seen_by_depth(const View& view, const SourceInfo& source) {
  Seen& seen = seen_[view.id];
  if (seen.view != view || seen.depth_camera != source.depth_camera ||
      seen.T_world_depth != source.T_world_depth ||
      seen.blocks.columns != source.confirmed_color.columns ||
      seen.blocks.rows != source.confirmed_color.rows ||
      seen.blocks.tile_px != source.confirmed_color.tile_px)
    seen = {view, source.depth_camera, source.T_world_depth,
            sensor::tiles_in_depth(source.depth_camera, view.camera(),
                                   source.T_world_depth.inverse() * view.T_world_camera,
                                   source.confirmed_color.tile_px, sensor::NearAndFar::both)};
  return seen.blocks;
}

void RootAtlas::update_plates(const Tick& tick, const Mesh& moving) {
  const atlas::Pictures pictures = pictures_of(tick.captures);
  struct Work {
    atlas::CleanPlate* plate;
    const View* view;
    const SourceInfo* source;
    const ImageRgb* picture;
    const TileMask* seen;
  };
  std::vector<Work> all;
  for (const SourceInfo& source : tick.sources) {
    const auto view = std::ranges::find(tick.views, view_of(source.sensor), &View::id);
    if (view == tick.views.end() || !source.confirmed_color.is_of(view->width, view->height))
      continue;
    const auto picture = pictures.find(view->stream);
    if (picture == pictures.end() || !picture->second) continue;
    all.push_back({&plates_[view->id], &*view, &source, picture->second.get(),
                   &seen_by_depth(*view, source)});
  }
  std::vector<std::size_t> changed(all.size());
  parallel_for(all.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto& [plate, view, source, picture, seen] = all[i];
      TileMask unhidden = source->confirmed_color;
      if (source->blind_color.is_of(view->width, view->height) &&
          source->blind_color.tile_px == unhidden.tile_px)
        for (std::size_t t = 0; t < unhidden.tiles.size(); ++t)
          unhidden.tiles[t] &= source->blind_color.tiles[t] == 0;
      hide(moving, *view, *seen, unhidden);
      plate->update(*picture, unhidden);
      changed[i] = plate->changed_blocks();
    }
  });
  changed_blocks_ = std::accumulate(changed.begin(), changed.end(), std::size_t{0});
  blocks_waiting_ += changed_blocks_;
}

atlas::PictureSampler RootAtlas::live_colors(const CaptureSet& captures) const {
  return {pictures_of(captures), colors_.live()};
}

atlas::PictureSampler RootAtlas::plate_colors(const std::vector<View>& views) const {
  atlas::Pictures pictures;
  for (const View& view : views)
    if (const auto plate = plates_.find(view.id); plate != plates_.end())
      pictures[view.stream] = std::make_shared<const ImageRgb>(plate->second.picture());
  return {std::move(pictures), colors_.plates()};
}

void RootAtlas::recall(Memory memory) {
  plates_ = std::move(memory.plates), colors_ = std::move(memory.colors);
  windows_ = std::move(memory.windows);
  blocks_waiting_ = valid_blocks();
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

/// Places the tiles of the views; a changed arrangement gets a new layout id.
Status RootAtlas::arrange(const std::vector<View>& views, double scale,
                          atlas::Layout& layout) const {
  const std::uint32_t current = layout.views.empty() ? 0 : layout.views.front().layout;
  auto made = atlas::make_layout(views, scene_->atlas, scale, current);
  if (!made) return made.error();
  const auto same_tile = [](const View& a, const View& b) {
    return a.id == b.id && a.atlas_rect == b.atlas_rect;
  };
  if (!std::ranges::equal(made->views, layout.views, same_tile))
    for (View& view : made->views) view.layout = current + 1;
  layout = *std::move(made);
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

/// Restricts the live tiles of views with plates to a window around the motion.
std::vector<View> RootAtlas::windows(const std::vector<View>& views, const Used& used) {
  std::vector<View> out = views;
  for (View& view : out)
    if (plates_.contains(view.id))
      view.image_rect = windows_[view.id].follow(bounds_of(used.at(view.id)), view.image_rect);
  return out;
}

/// Draws the live atlas: used pixels, on a background of the plates, which the video encoder skips
/// because it does not change. In views without a plate, unused pixels are black.
ImageRgb RootAtlas::draw_live(const Children& children, const atlas::Pictures& pictures,
                              Used used) {
  atlas::PicturesBehind behind;
  for (const auto& [id, view] : children)
    if (const auto plate = shown_plates_.find(view.stream); plate != shown_plates_.end())
      behind[id] = plate->second.get();
    else if (const auto raw = plates_.find(id); raw != plates_.end())
      behind[id] = &raw->second.picture();
  return atlas::compose_atlas(live_layout_,
                              {.children = children,
                               .pictures = pictures,
                               .used = std::move(used),
                               .mask = scene_->atlas.mask,
                               .behind = std::move(behind)},
                              std::exchange(spare_, {}));
}

/// The children's alpha, arranged as the live atlas is.
std::vector<AlphaPlane> RootAtlas::draw_alpha(const Tick& tick, const Children& children,
                                              const Used& used) const {
  const auto alpha = atlas::compose_alpha(live_layout_, {children, alpha_of(tick.captures), used});
  if (!alpha) return {};
  return {{kLiveStream, alpha->step_px, alpha->plane.width, alpha->plane.height,
           codec::encode_alpha(alpha->plane)}};
}

/// Encodes a picture unless it equals the last one, which is no coarser, and no key frame was
/// requested.
Status RootAtlas::add_unit(TextureStream& stream, int qp, std::uint32_t layout, ImageRgb picture,
                           Coded& last, Packet& packet) {
  if (picture == last.picture && qp >= last.qp && !stream.key_frame_asked()) {
    spare_ = std::move(picture);
    return {};
  }
  auto unit = stream.encode(picture, qp, layout);
  if (!unit) return unit.error();
  spare_ = std::exchange(last.picture, std::move(picture));
  last.qp = qp;
  packet.textures.push_back(*std::move(unit));
  return {};
}

Result<RootAtlas::Drawn> RootAtlas::draw(const Tick& tick, const Mesh& moving, const Mesh* still,
                                         float error_m, const CodingPlan& plan,
                                         std::uint64_t sequence, const PlateLimits& limits) {
  Used used;
  if (scene_->atlas.mask || !plates_.empty()) used = used_pixels(tick, moving, error_m);
  const Status live = arrange(windows(tick.views, used), plan.texture_scale, live_layout_);
  if (!live) return live.error();
  const Status plates = arrange(tick.views, plan.plate_scale, plate_layout_);
  if (!plates) return plates.error();
  Children children;
  for (const View& view : tick.views) children[view.id] = view;
  const atlas::Pictures pictures = pictures_of(tick.captures);
  atlas::ValidTiles seeing = seeing_tiles(tick.views, tick.sources);
  colors_.update({tick.views, pictures, seeing, moving, still, plates_, changed_blocks_});

  Drawn out;
  out.live_layout = live_layout_.views.front().layout;
  out.plate_layout = plate_layout_.views.front().layout;
  out.alpha = draw_alpha(tick, children, used);
  const std::optional<DuePlates> due =
      still && !plates_.empty() ? due_plates(plan.plate_qp, limits) : std::nullopt;
  const bool is_drawn = due && !due->band;
  if (is_drawn) sent_plates_ = plate_layout_.views;
  out.views = shown_views(still != nullptr);
  if (is_drawn)
    shown_plates_ =
        painter_.plates(tick.views, plates_, used_pixels(tick, *still, error_m), *still, colors_);
  const atlas::Pictures shown =
      painter_.live({tick.views, pictures, std::move(seeing)}, used, moving, still, colors_);
  out.live = draw_live(children, shown, std::move(used));
  if (scene_->atlas.burn_sequence) atlas::draw_watermark(out.live, sequence);
  if (!due) return out;
  if (is_drawn) out.plates = draw_plates(children);
  out.plate_qp = due->qp, out.plate_blocks = due->blocks, out.plate_band = due->band;
  return out;
}

Status RootAtlas::encode(Drawn drawn, Packet& packet) {
  packet.views = std::move(drawn.views);
  packet.alpha = std::move(drawn.alpha);
  Status coded = add_unit(live_, packet.plan.texture_qp, drawn.live_layout, std::move(drawn.live),
                          last_live_, packet);
  if (coded && drawn.plate_band) return refine_plates(drawn, packet);
  if (!drawn.plates) return coded;
  if (coded) coded = add_plates(drawn, packet);
  if (!coded) drawn_layout_ = 0;  // of no layout: the plates are due with the next packet
  return coded;
}

Status RootAtlas::add_plates(Drawn& drawn, Packet& packet) {
  packet.plan.plate_qp = drawn.plate_qp;
  const std::size_t before = packet.textures.size();
  const Status coded = add_unit(plate_, drawn.plate_qp, drawn.plate_layout,
                                *std::move(drawn.plates), last_plate_, packet);
  if (!coded || packet.textures.size() == before) return coded;
  const TextureUnit& unit = packet.textures.back();
  rows_.note_picture(spare_, last_plate_.picture, drawn.plate_qp, unit.key_frame);
  note_plate_bytes(unit.data.size(), drawn.plate_blocks, drawn.plate_qp);
  return {};
}

/// Of the last picture, a band. Where a key frame was asked for meanwhile, the next packet brings
/// it.
Status RootAtlas::refine_plates(const Drawn& drawn, Packet& packet) {
  if (plate_.key_frame_asked()) return {};
  packet.plan.plate_qp = drawn.plate_qp;
  const ImageRgb& picture = last_plate_.picture;
  auto unit = plate_.refine(picture, drawn.plate_qp, drawn.plate_layout, *drawn.plate_band);
  if (!unit) return unit.error();
  if (unit->key_frame) {
    rows_.note_picture(picture, picture, drawn.plate_qp, true);
  } else {
    rows_.note_band(*drawn.plate_band, drawn.plate_qp);
    note_plate_bytes(unit->data.size(), drawn.plate_blocks, drawn.plate_qp);
  }
  packet.textures.push_back(*std::move(unit));
  return {};
}

/// The live views, each followed by the view of its plate, where that was sent: in its place of
/// then.
std::vector<View> RootAtlas::shown_views(bool with_plates) const {
  std::vector<View> out;
  for (std::size_t i = 0; i < live_layout_.views.size(); ++i) {
    out.push_back(live_layout_.views[i]);
    const ViewId id = live_layout_.views[i].id;
    const auto sent = std::ranges::find(sent_plates_, id, &View::id);
    if (!with_plates || !plates_.contains(id) || sent == sent_plates_.end()) continue;
    View& view = out.emplace_back(plate_layout_.views[i]);
    view.atlas_rect = sent->atlas_rect, view.layout = sent->layout;
    view.layer = Layer::still, view.stream = kPlateStream, view.gain = colors_.exposure();
  }
  return out;
}

/// Whether the atlas of plates has something new to be encoded. A few changed blocks wait for more:
/// encoding the picture costs the same for one block as for all.
bool RootAtlas::are_plates_new(std::uint32_t layout) {
  constexpr int kWait = 15;          // ticks
  constexpr std::size_t kMany = 20;  // 1/kMany of all blocks do not wait
  if (plate_colors_ != colors_.plates() || drawn_layout_ != layout || plate_.key_frame_asked())
    return true;
  if (blocks_waiting_ == 0) return plates_due_ = false;
  return ++waited_ >= kWait || plates_due_ || kMany * blocks_waiting_ >= valid_blocks();
}

/// About what so many new blocks of plates take with a quantiser.
double RootAtlas::plate_bytes(std::size_t blocks, int qp) const {
  return static_cast<double>(blocks) * block_bytes_ * std::exp(-rate::kPerQp * (qp - kUsualQp));
}

/// Learns what blocks take. Many change next to nothing, and tell little of those that do.
void RootAtlas::note_plate_bytes(std::size_t bytes, std::size_t blocks, int qp) {
  constexpr std::size_t kFew = 50;
  constexpr double kLess = 1.1, kMore = 2;  // factors, at most, at once
  if (blocks < kFew) return;
  const double of_block = static_cast<double>(bytes) / static_cast<double>(blocks) *
                          std::exp(rate::kPerQp * (qp - kUsualQp));
  block_bytes_ = std::clamp(of_block, block_bytes_ / kLess, block_bytes_ * kMore);
}

/// How the atlas of plates is to be encoded now; nothing: it is as good as it can be, or waits.
std::optional<RootAtlas::DuePlates> RootAtlas::due_plates(int best_qp, const PlateLimits& limits) {
  plates_held_ = false, waiting_ = {};
  if (are_plates_new(plate_layout_.views.front().layout)) return new_plates(best_qp, limits);
  if (limits.may_refine) return refined_plates(best_qp, limits);
  waiting_ = {0, rows_.mean_qp(), static_cast<double>(best_qp)};  // still surface comes first
  return std::nullopt;
}

/// What is new comes with the finest quantiser that fits. What was coarser than that becomes finer
/// with it.
std::optional<RootAtlas::DuePlates> RootAtlas::new_plates(int best_qp, const PlateLimits& limits) {
  constexpr int kCoarsestQp = rate::kCoarsestPlateQp;
  const bool is_whole = plate_.key_frame_asked() || drawn_layout_ == 0 ||
                        drawn_layout_ != plate_layout_.views.front().layout;
  const std::size_t all = valid_blocks();
  const auto blocks_at = [&](int qp) {
    const auto coarser =
        static_cast<std::size_t>(static_cast<double>(all) * rows_.coarser_than(qp));
    return is_whole ? all : std::min(blocks_waiting_ + coarser, all);
  };
  const double fresh =
      is_whole ? 1 : static_cast<double>(std::min(blocks_waiting_, all)) / std::max<double>(all, 1);
  waiting_ = {plate_bytes(blocks_at(best_qp), best_qp),
              fresh * kCoarsestQp + (1 - fresh) * rows_.mean_qp(), static_cast<double>(best_qp)};
  int qp = best_qp;
  while (qp < kCoarsestQp && plate_bytes(blocks_at(qp), qp) > limits.now.bytes) ++qp;
  if (plate_bytes(blocks_at(qp), qp) <= limits.now.bytes || limits.now.one_anyway)
    return DuePlates{qp, blocks_at(qp)};
  plates_held_ = true;
  return std::nullopt;
}

/// What is coarser than the best quantiser comes again: all at once, or in bands, each as large as
/// may ever be sent.
std::optional<RootAtlas::DuePlates> RootAtlas::refined_plates(int best_qp,
                                                              const PlateLimits& limits) {
  constexpr double kWorthIt = 0.8;    // of the largest: each band takes the coding of a picture
  constexpr double kRounding = 1e-9;  // the limit was made from what waits
  const std::size_t all = valid_blocks();
  const double whole = plate_bytes(all, best_qp), coarse = rows_.coarser_than(best_qp);
  waiting_ = {whole * coarse, rows_.mean_qp(), static_cast<double>(best_qp)};
  if (waiting_.bytes <= 0) return std::nullopt;
  const double now = limits.now.bytes * (1 + kRounding);
  if (whole <= now) return DuePlates{best_qp, all};
  if (waiting_.bytes > now && now < kWorthIt * limits.largest_bytes) return std::nullopt;
  const auto band = rows_.first_coarser_than(best_qp, now / whole);
  if (!band) return std::nullopt;
  const double share = rows_.coarser_than(best_qp, *band);
  return DuePlates{best_qp, static_cast<std::size_t>(static_cast<double>(all) * share), band};
}

ImageRgb RootAtlas::draw_plates(const Children& children) {
  blocks_waiting_ = 0, waited_ = 0, plates_due_ = false;
  plate_colors_ = colors_.plates(), drawn_layout_ = plate_layout_.views.front().layout;
  return atlas::compose_atlas(plate_layout_, {.children = children, .pictures = shown_plates_},
                              std::exchange(spare_, {}));
}

namespace {

constexpr int kStep_px = 64, kSize_px = 128;  // of windows: of their places, of their sizes

/// A window, or what it is to show, along one axis; pixels.
struct Extent {
  int first = 0, size = 0;

  int end() const { return first + size; }
  bool holds(const Extent& other) const { return first <= other.first && other.end() <= end(); }
};

int step_before(int at, const Extent& whole) {
  return whole.first + (at - whole.first) / kStep_px * kStep_px;
}

/// The size of a window that begins at a step and ends with what is wanted.
int needed_size(const Extent& wanted, const Extent& whole) {
  return wanted.end() - step_before(wanted.first, whole);
}

/// That, with a reserve.
int ample_size(int needed, int whole) {
  return std::min((needed + needed / 4 + kSize_px - 1) / kSize_px * kSize_px, whole);
}

/// Where a window may stay, it does: after a move, the video finds nothing where it was. Else it
/// moves as far as it can, as what left it will go on.
int place(const Extent& window, const Extent& wanted, const Extent& whole) {
  if (window.holds(wanted) && whole.holds(window)) return window.first;
  Extent moved{step_before(wanted.end() - window.size + kStep_px - 1, whole), window.size};
  const bool goes_left = wanted.first < window.first;
  if (!goes_left || !moved.holds(wanted) || !whole.holds(moved))
    moved.first = step_before(wanted.first, whole);
  return std::clamp(moved.first, whole.first, whole.end() - window.size);
}

}  // namespace

Rect RootAtlas::Window::follow(const Rect& wanted, const Rect& whole) {
  constexpr int kLookBackEvery = 32;
  constexpr double kWorthShrinking = 0.75;
  if (wanted.empty()) {
    if (rect.empty())
      rect = {whole.x, whole.y, std::min(kStep_px, whole.width), std::min(kStep_px, whole.height)};
    return rect;
  }
  rect.width = std::min(rect.width, whole.width), rect.height = std::min(rect.height, whole.height);
  const Extent wanted_x{wanted.x, wanted.width}, wanted_y{wanted.y, wanted.height},
      whole_x{whole.x, whole.width}, whole_y{whole.y, whole.height};
  const Size need{needed_size(wanted_x, whole_x), needed_size(wanted_y, whole_y)};
  const auto grow = [](const Extent& window, const Extent& part, int needed, int most) {
    const bool is_enough = window.holds(part) || window.size >= needed;
    return is_enough ? window.size : ample_size(needed, most);
  };
  rect.width = grow({rect.x, rect.width}, wanted_x, need.width, whole.width);
  rect.height = grow({rect.y, rect.height}, wanted_y, need.height, whole.height);
  lately = {std::max(lately.width, need.width), std::max(lately.height, need.height)};
  if (++ticks % kLookBackEvery == 0) {
    const Size most{ample_size(std::max(lately.width, before.width), whole.width),
                    ample_size(std::max(lately.height, before.height), whole.height)};
    const auto area = [](int width, int height) { return static_cast<double>(width) * height; };
    if (area(most.width, most.height) < kWorthShrinking * area(rect.width, rect.height))
      rect.width = most.width, rect.height = most.height;
    before = std::exchange(lately, {});
  }
  rect.x = place({rect.x, rect.width}, wanted_x, whole_x);
  rect.y = place({rect.y, rect.height}, wanted_y, whole_y);
  return rect;
}

}  // namespace mr::node
