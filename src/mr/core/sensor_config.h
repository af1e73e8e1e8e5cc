#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/ids.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/core/source_config.h"
#include "mr/core/trajectory.h"

namespace mr {

struct SensorConfig {
  std::string id;
  SourceConfig source;
  Camera depth_camera;
  std::optional<Camera> color_camera;  ///< none: the sensor has no colour
  Pose T_color_depth;                  ///< depth-camera point → colour camera
  std::vector<Pose> T_world_depth;     ///< one for a static sensor, else one per item; or those of
                                       ///< the trajectory, evenly thinned out
  Trajectory trajectory;  ///< T_world_depth over the source's own time; empty: T_world_depth holds
  bool moving = false;    ///< no surface that stays is learnt; also where there are several poses
  double depth_near_m = 0.3, depth_far_m = 5.0;
  Precision precision;
  double clock_offset_ms = 0;  ///< added to the source's times
  double clock_drift_ppm = 0;  ///< how much too slow the source's clock runs
  /// Items whose pose file is missing or invalid, with the reason: their frames are lost.
  /// T_world_depth has a neighbour's pose in their place.
  std::map<std::size_t, Error> lost_poses{};

  static constexpr Range kDepth_m{0, 1000}, kClockOffset_ms{-1e7, 1e7},
      kClockDrift_ppm{-1000, 1000};

  bool is_moving() const { return moving || T_world_depth.size() > 1; }
  /// The pose of a frame: of its item, or where there is a trajectory of its time by the source's
  /// own clock. Errors: the item's pose is lost; the trajectory has none at that time.
  Result<Pose> pose_of(std::size_t item, TimePoint own_time) const;

  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  friend bool operator==(const SensorConfig&, const SensorConfig&) = default;
};

/// The ids of all sensors, in the order of the scene.
inline std::vector<SensorId> all_sensors(const std::vector<SensorConfig>& sensors) {
  std::vector<SensorId> out;
  for (std::size_t i = 0; i < sensors.size(); ++i) out.push_back(sensor_at(i));
  return out;
}

}  // namespace mr
