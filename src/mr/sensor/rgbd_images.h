#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/range.h"
#include "mr/core/sensor_config.h"
#include "mr/sensor/source_registry.h"

namespace mr::sensor {

/// Colour and depth as files; item i of one belongs to item i of the other.
struct RgbdImagesSource {
  static constexpr std::string_view kType = "rgbd-images";

  std::vector<std::filesystem::path> color;  ///< JPEG or PNG; empty: the sensor has no colour
  std::vector<std::filesystem::path> depth;  ///< 16-bit PNG or PGM
  double depth_unit_m = 0.001;               ///< metres per count
  std::vector<std::uint16_t> invalid{0};     ///< counts that mean "no depth"
  bool loop = false;                         ///< start again after the last
  /// When each item was captured, increasing, by a clock of their own; empty: item i at i / fps.
  std::vector<TimePoint> times{};

  static constexpr Range kDepthUnit_m{0, 1, true};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"depth_unit_m", depth_unit_m, kDepthUnit_m}});
  }
  SourceContent content() const { return {depth.size(), loop}; }
  std::vector<std::filesystem::path> files() const;
  /// Of the items' times, as seconds since 1970; nothing where they have none.
  std::optional<SourceClock> clock() const;
  /// A hint at a wrong unit of depth, if the median is implausible for a room.
  std::optional<std::string> depth_hint(double median_m) const;
  friend bool operator==(const RgbdImagesSource&, const RgbdImagesSource&) = default;
};

/// Reads a sensor's frames from image files. Frame i is exposed at
/// i / fps after the epoch plus the sensor's clock offset; a looping source goes on counting. Items
/// with times of their own are played by RecordedFrames.
/// Depth outside [depth_near_m, depth_far_m] and the invalid counts become 0. A picture that is
/// corrupt, truncated or of another size than its camera is an error that names the file; the
/// frame is lost, the next call goes on. The sensor's source must be an RgbdImagesSource.
std::unique_ptr<FrameSource> open_rgbd_images(const SensorConfig& sensor, SensorId id,
                                              const Timeline& timeline);

/// The keys depth, color, depth_unit_m, invalid, loop and times.
SourceKeys read_rgbd_images(yaml::MapReader& map, const std::string& key);
/// The key `invalid`: one count or a list.
void read_invalid_counts(yaml::MapReader& map, std::vector<std::uint16_t>& out);

}  // namespace mr::sensor
