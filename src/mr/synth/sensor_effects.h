#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/frame.h"
#include "mr/synth/rig_config.h"

namespace mr::synth {

/// Whether an event is under way at a capture of its rig.
inline bool is_under_way(const RigEvent& event, std::uint64_t capture) {
  const auto at = static_cast<std::uint64_t>(event.at);
  return capture >= at && capture - at < static_cast<std::uint64_t>(event.frames);
}

/// The room's light at a capture as a fraction of the usual one, after `light` events.
double light_level(const RigConfig& rig, std::uint64_t capture);

/// Effects applied to one sensor's rendered pictures: light switches, drifting, jumping and hunting
/// exposure, colour noise, and depth dropouts.
class SensorEffects {
 public:
  SensorEffects(const RigConfig& rig, std::uint32_t sensor, double fps);

  /// `index` counts on where the rig loops: drift and noise do not repeat.
  void apply(std::uint64_t index, Frame& frame) const;

  /// Exposure error at a capture in stops, without the rig's exposure_spread.
  double exposure_stops(std::uint64_t index) const;

 private:
  void add_color_noise(std::uint64_t index, ImageRgb& color) const;

  const RigConfig rig_;
  const std::uint32_t sensor_;
  const double fps_;
  std::vector<RigEvent> events_;  // those that affect this sensor
};

}  // namespace mr::synth
