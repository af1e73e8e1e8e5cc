#pragma once

#include <span>
#include <string>
#include <vector>

#include "mr/core/sensor_config.h"
#include "mr/core/timeline.h"

namespace mr::sensor {

/// Lays the clocks of all sensors' recordings on the scene's clock. Recordings of one domain whose
/// spans meet (or lie less than ten seconds apart) keep their differences in time: the earliest
/// begins at 0. Others begin at 0, each by itself. All that loop and know their length start again
/// together, after the longest.
std::vector<Timeline> timelines(std::span<const SensorConfig> sensors, double fps);

/// What is odd about the clocks, one line each: sensors of one clock that begin seconds apart, as
/// where a master was started before its subordinates.
std::vector<std::string> timeline_notes(std::span<const SensorConfig> sensors);

}  // namespace mr::sensor
