#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "mr/core/ids.h"
#include "mr/core/image.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

namespace mr {

using Duration = std::chrono::nanoseconds;
using TimePoint = std::chrono::sys_time<Duration>;  ///< ns since the Unix epoch

/// Whether a periodic action, last done at `last`, is due again. Also true when the clock was set
/// back.
inline bool is_due(const std::optional<TimePoint>& last, Duration every, TimePoint now) {
  return !last || now - *last >= every || now < *last;
}

/// One sensor's capture.
struct Frame {
  SensorId sensor{};
  std::uint64_t index = 0;                     ///< counts from 0 at the source
  TimePoint exposure_start{}, exposure_end{};  ///< a LiDAR sweep lasts 100 ms
  ImageDepth depth;                            ///< [H, W] metres in depth-camera pixels, 0 invalid
  ImageRgb color;      ///< in colour-camera pixels; empty where the sensor has no colour
  Pose T_world_depth;  ///< depth camera → world
  /// Why there is no colour where the sensor has some: its picture is damaged, missing, or the
  /// camera is lost.
  std::optional<Error> color_lost{};

  TimePoint captured_at() const { return exposure_start + (exposure_end - exposure_start) / 2; }
};

}  // namespace mr
