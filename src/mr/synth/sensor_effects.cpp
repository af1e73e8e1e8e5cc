#include "mr/synth/sensor_effects.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mr/synth/hash.h"
#include "mr/synth/noise.h"
#include "mr/synth/pixel_shader.h"
#include "mr/synth/posed_camera.h"

namespace mr::synth {

double light_level(const RigConfig& rig, std::uint64_t capture) {
  double level = 1;
  for (const RigEvent& event : rig.events)
    if (event.kind == RigEvent::Kind::light && is_under_way(event, capture)) level *= event.level;
  return level;
}

SensorEffects::SensorEffects(const RigConfig& rig, std::uint32_t sensor, double fps)
    : rig_(rig), sensor_(sensor), fps_(fps) {
  const std::string id = rig.sensor_ids().at(sensor);
  for (const RigEvent& event : rig.events)
    if (event.sensor.empty() || event.sensor == id) events_.push_back(event);
}

double SensorEffects::exposure_stops(std::uint64_t index) const {
  using Kind = RigEvent::Kind;
  const auto wave = [](double turns) { return std::sin(2 * std::numbers::pi * turns); };
  double stops = 0;
  if (rig_.exposure_drift > 0) {
    const double phase = unit(mix(mix(rig_.seed, 0xD1), sensor_));
    stops = rig_.exposure_drift *
            wave(phase + static_cast<double>(index) / fps_ / rig_.exposure_period_s);
  }
  const std::uint64_t capture = index % static_cast<std::uint64_t>(rig_.frames);
  for (const RigEvent& event : events_) {
    if (!is_under_way(event, capture)) continue;
    const double since_s = (static_cast<double>(capture) - event.at) / fps_;
    if (event.kind == Kind::exposure) stops += event.stops;
    if (event.kind == Kind::hunt) stops += event.stops * wave(since_s / event.period_s);
  }
  return stops;
}

void SensorEffects::add_color_noise(std::uint64_t index, ImageRgb& color) const {
  const std::uint64_t seed = mix(mix(mix(rig_.seed, 0xC1), sensor_), index);
  const auto sigma = static_cast<float>(rig_.color_noise);
  const std::size_t row = 3 * static_cast<std::size_t>(color.width);
  for_rows(color.height, [&](int y) {
    for (std::size_t i = y * row; i < (y + 1) * row; ++i) {
      const float value = static_cast<float>(color.data[i]) + sigma * normal_deviate(mix(seed + i));
      color.data[i] = static_cast<std::uint8_t>(std::clamp(value + 0.5f, 0.0f, 255.0f));
    }
  });
}

void SensorEffects::apply(std::uint64_t index, Frame& frame) const {
  const std::uint64_t capture = index % static_cast<std::uint64_t>(rig_.frames);
  const double light = light_level(rig_, capture) * std::exp2(exposure_stops(index));
  if (light != 1) {
    const auto table = relit(light);
    for (std::uint8_t& value : frame.color.data) value = table[value];
  }
  if (rig_.color_noise > 0) add_color_noise(index, frame.color);
  for (const RigEvent& event : events_)
    if (event.kind == RigEvent::Kind::dropout && is_under_way(event, capture))
      std::fill(frame.depth.data.begin(), frame.depth.data.end(), 0.0f);
}

}  // namespace mr::synth
