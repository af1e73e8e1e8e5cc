#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/ids.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

namespace mr {

/// Colour and depth as files; item i of one belongs to item i of the other.
struct RgbdImagesSource {
  std::vector<std::filesystem::path> color;  ///< JPEG or PNG; empty: the sensor has no colour
  std::vector<std::filesystem::path> depth;  ///< 16-bit PNG or PGM
  double depth_unit_m = 0.001;               ///< metres per count
  std::vector<std::uint16_t> invalid{0};     ///< counts that mean "no depth"
  bool loop = false;                         ///< start again after the last
  friend bool operator==(const RgbdImagesSource&, const RgbdImagesSource&) = default;
};

/// One sensor of the synthetic rig; which one follows from its place in the rig: the Kinects come
/// first, then the LiDARs.
struct SyntheticSource {
  std::uint32_t camera = 0;
  friend bool operator==(const SyntheticSource&, const SyntheticSource&) = default;
};

struct SensorConfig {
  std::string id;
  std::variant<RgbdImagesSource, SyntheticSource> source;
  Camera depth_camera;
  std::optional<Camera> color_camera;  ///< none: the sensor has no colour
  Pose T_color_depth;                  ///< depth-camera point → colour camera
  std::vector<Pose> T_world_depth;     ///< one for a static sensor, else one per item
  double depth_near_m = 0.3, depth_far_m = 5.0;
  Precision precision;
  double clock_offset_ms = 0;  ///< added to the source's times
  /// Items whose pose file is missing or cannot be used, and why: their frames are lost. In
  /// T_world_depth they have a neighbour's.
  std::map<std::size_t, Error> lost_poses{};
  friend bool operator==(const SensorConfig&, const SensorConfig&) = default;
};

/// All of a scene's sensors, in its order.
inline std::vector<SensorId> all_sensors(const std::vector<SensorConfig>& sensors) {
  std::vector<SensorId> out;
  for (std::size_t i = 0; i < sensors.size(); ++i) out.push_back(sensor_at(i));
  return out;
}

}  // namespace mr
