#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "mr/core/frame_source.h"
#include "mr/core/sensor_config.h"
#include "mr/core/timeline.h"
#include "mr/yaml/map_reader.h"

/// The types of sources that scene files can name. A new one is a config, a reader of its keys and
/// an opener in a file of this folder, and a line in source_registry.cpp.
namespace mr::sensor {

/// What a recording or a device tells of its own cameras: the scene need not state them.
struct SourceCameras {
  Camera depth;
  std::optional<Camera> color;
  Pose T_color_depth;  ///< unless the scene states it
  double depth_near_m = 0.3, depth_far_m = 5;
  Precision precision;
};

/// What the keys of a sensor's `source` say.
struct SourceKeys {
  SourceConfig config;
  bool has_color = false;  ///< the sensor needs a colour camera
  /// Nothing: the scene has to state them. Anything where a problem was reported.
  std::optional<SourceCameras> cameras{};
  /// Why a camera is missing in `cameras`, or all are: to be told where the scene does not state
  /// it.
  std::string no_camera{};
  Pose T_picture_color{};  ///< from the colour camera that the scene means to that of its pictures
};

struct SourceType {
  std::string_view name;  ///< the value of `source.type`
  /// Reads the keys beside `type` and reports their problems. `key`: of the source in the
  /// scene, such as "sensors.cam-0.source".
  SourceKeys (*read)(yaml::MapReader& map, const std::string& key);
  /// Opens the source of a sensor, whose config is of this type. Failures are reported by
  /// FrameSource::next().
  std::unique_ptr<FrameSource> (*open)(const SensorConfig& sensor, SensorId id,
                                       const Timeline& timeline);
};

/// All types, in the order of listings and messages.
std::span<const SourceType> source_types();

/// Null where no type has that name.
const SourceType* find_source_type(std::string_view name);

}  // namespace mr::sensor
