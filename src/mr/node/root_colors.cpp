#include "mr/node/root_colors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

namespace mr::node {
namespace {

constexpr int kEvery = 30, kLeastPlates = 10, kMostPlates = 100;  // ticks between estimates
constexpr std::size_t kManyBlocks = 20;  // 1/kManyBlocks of the valid blocks
constexpr float kShare = 0.3f;
constexpr float kGamma = 2.2f;  // of sRGB: a factor on its values as one on light

std::size_t valid_blocks(const RootColors::Plates& plates) {
  std::size_t out = 0;
  for (const auto& [id, plate] : plates)
    out += static_cast<std::size_t>(std::ranges::count(plate.valid().tiles, 1));
  return out;
}

std::set<ViewId> pictured(const RootColors::Tick& tick) {
  std::set<ViewId> out;
  for (const View& view : tick.views)
    if (const auto found = tick.live.find(view.stream); found != tick.live.end() && found->second)
      out.insert(view.id);
  return out;
}

/// The least change that all have in common: 0 if some brighten and others darken.
float common(const std::vector<float>& changes) {
  const auto [low, high] = std::ranges::minmax(changes);
  return low > 0 ? low : high < 0 ? high : 0;
}

double median(std::vector<double> of) {
  std::ranges::sort(of);
  return of.empty() ? 0 : of[(of.size() - 1) / 2];
}

/// What looks wrong with a camera; `usual`: the misfit of the other cameras.
std::string note_on(const atlas::ColorBalance::Finding& found, double usual) {
  constexpr double kManyStops = 1, kMisfit = 0.2, kUnusual = 2;
  const double light = (found.gain.x + found.gain.y + found.gain.z) / 3.0;
  const double stops = std::log2(light);
  std::string out;
  if (std::abs(stops) >= kManyStops)
    out = fmt::format("{:.1f} stops {} than the others", std::abs(stops),
                      stops > 0 ? "darker" : "brighter");
  if (found.misfit > kMisfit && found.misfit > kUnusual * usual)
    out += std::string(out.empty() ? "" : "; ") +
           "its colour does not lie on the surface: check T_color_depth and color_camera";
  return out;
}

}  // namespace

std::vector<CameraColor> RootColors::findings(const Scene& scene) const {
  std::vector<CameraColor> out;
  for (const auto& [id, found] : balance_.findings()) {
    if (!found.overlaps) continue;
    std::vector<double> others;
    for (const auto& [other, theirs] : balance_.findings())
      if (other != id && theirs.overlaps) others.push_back(theirs.misfit);
    out.push_back({scene.sensor(sensor_of(id)).id, found.gain, found.misfit,
                   note_on(found, median(std::move(others)))});
  }
  return out;
}

void RootColors::update(const Tick& tick) {
  follow_exposure(tick.plates);
  if (!corrects_) return;
  ++ticks_, changed_ += tick.changed_blocks;
  if (is_due(tick)) estimate(tick);
  balance_.follow(of_plates_);
}

bool RootColors::is_due(const Tick& tick) const {
  if (of_plates_ != (tick.still != nullptr) || pictured(tick) != views_) return true;
  if (!tick.still) return ticks_ >= kEvery;
  if (ticks_ < kLeastPlates || changed_ == 0) return false;
  return ticks_ >= kMostPlates || changed_ * kManyBlocks >= valid_blocks(tick.plates);
}

void RootColors::estimate(const Tick& tick) {
  atlas::Pictures pictures = tick.live;
  atlas::ValidTiles valid = tick.seeing;
  for (const View& view : tick.views) {
    const auto plate = tick.plates.find(view.id);
    if (!tick.still || plate == tick.plates.end() || plate->second.picture().empty()) continue;
    pictures[view.stream] = {std::shared_ptr<void>{}, &plate->second.picture()};
    valid[view.id] = plate->second.valid();
  }
  const Mesh& surface = tick.still ? *tick.still : tick.moving;
  balance_.estimate({surface, tick.views, pictures, valid}, tick.still ? 1 : kShare);
  sharpen(balance_.misplaced_px());
  views_ = pictured(tick), of_plates_ = tick.still != nullptr;
  ticks_ = 0, changed_ = 0;
}

/// In steps of a factor of 2, each kept while the best is not much nearer to another.
void RootColors::sharpen(double misplaced_px) {
  constexpr double kSmoothest = 0.5, kKept = 0.75;
  const double best =
      std::clamp(kSharpest / std::max(misplaced_px * misplaced_px, 1e-3), kSmoothest, kSharpest);
  if (std::abs(std::log2(best / sharpness_)) > kKept)
    sharpness_ = std::exp2(std::round(std::log2(best)));
}

void RootColors::follow_exposure(const Plates& plates) {
  exposure_ = {1, 1, 1};
  log_exposure_.clear();
  for (const auto& [id, plate] : plates) {
    if (std::ranges::count(plate.valid().tiles, 1) == 0) continue;  // its exposure is not known
    const Vec3f gain = plate.gain();
    log_exposure_[id] = {std::log(gain.x), std::log(gain.y), std::log(gain.z)};
  }
  if (log_exposure_.empty()) return;
  for (int c = 0; c < 3; ++c) {
    std::vector<float> changes;
    for (const auto& [id, log_gain] : log_exposure_) changes.push_back(log_gain[c]);
    const float all = common(changes);
    exposure_[c] = std::exp(all);
    for (auto& [id, log_gain] : log_exposure_) log_gain[c] = kGamma * (all - log_gain[c]);
  }
}

atlas::ColorCorrections RootColors::plates() const {
  atlas::ColorCorrections out;
  for (const auto& [id, field] : balance_.fields()) out[id].field = field;
  return out;
}

atlas::ColorCorrections RootColors::live() const {
  atlas::ColorCorrections out = plates();
  for (const auto& [id, log_exposure] : log_exposure_) out[id].log_exposure = log_exposure;
  return out;
}

}  // namespace mr::node
