#include "mr/node/sensor_layers.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "mr/node/capture.h"
#include "mr/still/tiles.h"

namespace mr::node {
namespace {

// Behind a pixel of the still picture, once the room is learnt. Smoothed like a single reading,
// corners become round, and small things melt into the wall behind.
constexpr int kStillReadings = 16;

}  // namespace

SensorLayers::SensorLayers(const Scene& scene, SensorId id,
                           const sensor::Registration& registration, StillWork work, Trace& trace)
    : scene_(&scene),
      sensor_(&scene.sensor(id)),
      registration_(&registration),
      work_(work),
      trace_(&trace),
      background_(registration.depth_camera(), sensor_->T_world_depth.front(),
                  {.precision = sensor_->precision,
                   .fps = scene.fps,
                   .after_s = scene.still.after_s,
                   .chunk_m = scene.fusion.chunk_m,
                   .voxel_m = scene.voxel_m}),
      surface_(scene) {
  const Camera& depth = registration.depth_camera();
  const auto view = registration.color_view({});
  if (view && view->kind == View::Kind::pinhole && depth.model == CameraModel::pinhole)
    outline_.emplace(depth, view->camera(), view->T_world_camera.inverse());
}

still::BackgroundUpdate SensorLayers::observe(const Frame& frame, std::uint32_t shown) {
  const bool was_new = background_.is_new();
  const still::BackgroundUpdate update =
      trace_->time("background", [&] { return background_.update(frame.depth, shown); });
  const bool is_learnt = was_new && !background_.is_new();  // it is cleaned otherwise now
  is_outdated_ |= update.still_changed || is_learnt;
  began_anew_ |= update.was_reset;
  if (update.was_reset) plate_ = {};
  return update;
}

void SensorLayers::recall(Memory memory) {
  background_ = std::move(memory.background), plate_ = std::move(memory.plate);
  is_outdated_ = true;  // unchanged chunks are not reconstructed again
  shown_ = made_ = 0;
}

/// Of how many changes of the still picture the merger shows the surface. Where it does so with the
/// next tick, nobody is waited for: the background waits for some captures by itself. Who never
/// says so is not waited for for ever.
std::uint32_t SensorLayers::shown_changes() {
  // Captures. Where rate is controlled, still surface may wait for long before it is sent.
  constexpr int kPatience = 300, kPatienceWithRate = 3000;
  const bool is_fixed = scene_->rate.model == RateConfig::Model::fixed;
  const bool is_made = !is_outdated_ && !job_.is_busy() && unsent_.empty();
  if (work_ == StillWork::at_once && is_fixed) return is_made ? still::Background::kAll : 0;
  const std::lock_guard lock(sent_mutex_);
  const bool is_all_shown = is_made && on_the_way_.empty() && sent_.empty();
  if (is_all_shown) shown_ = made_;
  waited_ = is_all_shown ? 0 : waited_ + 1;
  return waited_ > (is_fixed ? kPatience : kPatienceWithRate) ? made_ : shown_;
}

/// The cleaned depth of a mask. Mixed pixels are known by the surfaces on both sides, so more than
/// the mask is cleaned; of panoramas and LiDARs, all.
ImageDepth SensorLayers::clean_where(const ImageMask& mask, const Camera& camera,
                                     const Frame& frame) const {
  constexpr int kAround_px = 16;
  std::vector<Rect> parts{{0, 0, mask.width, mask.height}};
  if (camera.model == CameraModel::pinhole) parts = still::covering_rectangles(mask, kAround_px);
  ImageDepth out(mask.width, mask.height);
  for (const Rect& r : parts) {
    Camera cropped = camera;
    cropped.width = r.width, cropped.height = r.height;
    cropped.cx -= r.x, cropped.cy -= r.y;
    Frame part;
    part.sensor = frame.sensor, part.T_world_depth = frame.T_world_depth;
    part.depth = ImageDepth(r.width, r.height);
    for (int y = 0; y < r.height; ++y)
      std::copy_n(frame.depth.at(r.x, r.y + y), r.width, part.depth.row(y));
    const ImageDepth clean = prepare_depth(*scene_, cropped, part);
    for (int y = 0; y < r.height; ++y)
      for (int x = 0; x < r.width; ++x)
        if (*mask.at(r.x + x, r.y + y)) *out.at(r.x + x, r.y + y) = *clean.at(x, y);
  }
  return out;
}

Result<SensorLayers::Divided> SensorLayers::divide(const Frame& frame, double still_error_m) {
  const Camera& camera = registration_->depth_camera();
  Divided out;
  // Until the still surface is shown, the moving one shows what has become still.
  still::BackgroundUpdate update = observe(frame, shown_changes());
  trace_->time("clean", [&] {
    out.moving = clean_where(update.moving, camera, frame);
    out.confirmed_depth = still::confirmed_tiles(update.confirmed, update.moving);
    if (const auto view = registration_->color_view(frame.T_world_depth);
        view && !frame.color.empty())
      out.confirmed_color =
          still::unoccluded_tiles(frame.depth, update.foreign, camera, view->camera(),
                                  view->T_world_camera.inverse() * frame.T_world_depth);
    out.moving_pixels = std::move(update.moving);
  });
  out.outline = trace_->time("outline", [&] { return find_outline(frame, out, update.foreign); });
  if (const Status updated = update_surface(frame, still_error_m); !updated) return updated.error();
  return out;
}

/// Also brings the plate up to date.
still::Outline SensorLayers::find_outline(const Frame& frame, const Divided& divided,
                                          const ImageMask& foreign) {
  if (!outline_ || frame.color.empty()) return {divided.moving, {}};
  plate_.update(frame.color, divided.confirmed_color);
  return outline_->find({frame.depth,
                         divided.moving,
                         divided.moving_pixels,
                         foreign,
                         {frame.color, plate_.picture(), plate_.valid(), plate_.gain()}});
}

/// The chunks of a still picture that changed. `readings`: behind its pixels.
SensorLayers::Chunks SensorLayers::reconstruct(const Frame& still, int readings, double error_m) {
  return trace_->time("still", [&] {
    const Camera& camera = registration_->depth_camera();
    return surface_.update(prepare_depth(*scene_, camera, still, readings), camera,
                           still.T_world_depth, sensor_->precision, error_m);
  });
}

/// Takes the chunks that were reconstructed, while no job is busy.
Status SensorLayers::accept(Chunks made) {
  if (!made) {
    is_outdated_ = true;
    return made.error();
  }
  chunks_ = surface_.chunks();
  made_ = begun_;
  std::ranges::move(*made, std::back_inserter(unsent_));  // newer ones come later
  return {};
}

/// Brings the still surface up to date with the background's still picture.
Status SensorLayers::update_surface(const Frame& frame, double error_m) {
  if (std::optional<Chunks> made = job_.take())
    if (const Status accepted = accept(*std::move(made)); !accepted) return accepted;
  const bool is_replanned = error_m != error_m_ && chunks_ > 0;
  if ((!is_outdated_ && !is_replanned) || job_.is_busy()) return {};
  is_outdated_ = false, error_m_ = error_m, begun_ = background_.changes();
  Frame still;
  still.sensor = frame.sensor, still.depth = background_.still();
  still.T_world_depth = frame.T_world_depth;
  const int readings = background_.is_new() ? 1 : kStillReadings;
  if (work_ == StillWork::at_once || background_.is_new())
    return accept(reconstruct(still, readings, error_m));
  job_.start([this, still = std::move(still), readings, error_m] {
    return reconstruct(still, readings, error_m);
  });
  return {};
}

SensorLayers::News SensorLayers::take_news() {
  News out{std::exchange(unsent_, {}), std::exchange(began_anew_, false)};
  if (out.chunks.empty()) return out;
  waited_ = 0;
  const std::lock_guard lock(sent_mutex_);
  on_the_way_.push_back(made_);
  return out;
}

void SensorLayers::note_sent(std::uint64_t sequence) {
  constexpr std::size_t kMostUnconfirmed = 64;
  const std::lock_guard lock(sent_mutex_);
  if (on_the_way_.empty()) return;
  sent_.emplace_back(sequence, on_the_way_.front());
  on_the_way_.pop_front();
  if (sent_.size() > kMostUnconfirmed) sent_.pop_front();  // the next one tells as much, later
}

void SensorLayers::note_shown(std::uint64_t sequence) {
  const std::lock_guard lock(sent_mutex_);
  for (; !sent_.empty() && sent_.front().first <= sequence; sent_.pop_front())
    shown_ = sent_.front().second;
}

}  // namespace mr::node
