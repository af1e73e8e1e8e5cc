#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/sensor_config.h"
#include "mr/core/timeline.h"
#include "mr/sensor/lidar_360/panorama.h"
#include "mr/sensor/source_registry.h"

namespace mr::sensor {

/// A LiDAR with a 360-degree camera beside it, as one sensor (paper, section 3.4): depth of any
/// other type of source, colour of the camera.
struct Lidar360Source {
  static constexpr std::string_view kType = "lidar-360";

  SourceConfig lidar;
  PanoramaConfig color;

  SourceContent content() const { return lidar.content(); }
  std::optional<SourceClock> clock() const { return lidar.clock(); }
  std::vector<std::string> problems() const;
  std::vector<std::filesystem::path> files() const;
  std::optional<std::string> depth_hint(double median_m) const {
    return lidar.depth_hint(median_m);
  }
  friend bool operator==(const Lidar360Source&, const Lidar360Source&) = default;
};

/// Each of the LiDAR's frames with the camera's picture nearest to the middle of its sweep. A
/// frame whose picture cannot be read comes without colour (Frame::color_lost).
std::unique_ptr<FrameSource> open_lidar_360(const SensorConfig& sensor, SensorId id,
                                            const Timeline& timeline);

/// The keys lidar, a source without colour, and color (read_panorama). T_color_depth of the scene
/// is the rigid transform from the LiDAR to the camera as it stands upright.
SourceKeys read_lidar_360(yaml::MapReader& map, const std::string& key);

}  // namespace mr::sensor
