#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/sensor_config.h"
#include "mr/synth/rig_config.h"

/// The errors injected into a rig, drawn from its seed, one set per sensor.
namespace mr::synth {

/// What turns a sensor's true pose into the one it states: T_world_stated = T_world_true * this.
/// Exactly calib_error_mm long and calib_error_deg wide, in a random direction and about a random
/// axis; the identity where both are 0.
Pose calibration_error(const RigConfig& rig, std::uint32_t sensor);

/// How an event `push` moves a sensor, by_mm long and by_deg wide: T_world_after = T_world_before *
/// this. In a random direction and about a random axis.
Pose push_of(const RigConfig& rig, const RigEvent& event, std::uint32_t sensor);

/// Factors on the linear light of red, green and blue: exposure within ± exposure_spread stops, red
/// and blue within a further quarter of it.
Vec3f exposure_gain(const RigConfig& rig, std::uint32_t sensor);

/// Clock error: how much later than stated a sensor captures, within ± clock_offset_ms.
double clock_error_s(const RigConfig& rig, std::uint32_t sensor);

/// The sensors of rig_sensors() with their true poses.
std::vector<SensorConfig> exact_sensors(const RigConfig& rig);

}  // namespace mr::synth
