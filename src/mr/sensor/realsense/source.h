#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/range.h"
#include "mr/core/sensor_config.h"
#include "mr/core/timeline.h"
#include "mr/sensor/recording_formats.h"
#include "mr/sensor/source_registry.h"

namespace mr::sensor {

/// A recording of an Intel RealSense (.bag), read without the SDK. Cameras come from the recording.
struct RealSenseBagSource {
  static constexpr std::string_view kType = "realsense-bag";
  static constexpr Range kDepthUnit_m{0, 1, true};

  std::filesystem::path file;
  std::optional<double> depth_unit_m;  ///< of a count; nothing: what the recording says
  bool loop = false;                   ///< start again after the last picture
  SourceClock recorded;                ///< by the file's first and last pictures
  std::size_t captures = 0;            ///< by the same; 0: not known

  SourceContent content() const { return {captures, loop}; }
  SourceClock clock() const { return recorded; }
  std::vector<std::filesystem::path> files() const { return {file}; }
  std::vector<std::string> problems() const;
  friend bool operator==(const RealSenseBagSource&, const RealSenseBagSource&) = default;
};

/// Opens the source of a sensor, which must be a RealSenseBagSource. Frames are captured when depth
/// was stamped. One whose depth is damaged is lost; one whose colour is missing or damaged comes
/// without colour (Frame::color_lost).
std::unique_ptr<FrameSource> open_realsense_bag(const SensorConfig& sensor, SensorId id,
                                                const Timeline& timeline);

/// The keys file, depth_unit_m and loop. Opens the recording for its cameras and its clock:
/// recordings that were stamped by the computer's clock share one, others have that of their
/// device.
SourceKeys read_realsense_bag(yaml::MapReader& map, const std::string& key);

/// For the registry of formats: files named .bag.
bool is_realsense_bag(const std::filesystem::path& path);
Result<RecordingInfo> describe_realsense_bag(const std::filesystem::path& path);
Result<ImportedScene> import_realsense_bag(const std::filesystem::path& path);

struct RealSenseHeader;
/// The cameras of a recording. Errors name its `file`.
Result<SourceCameras> realsense_cameras(const RealSenseHeader& header,
                                        const std::filesystem::path& file);
/// What is unusual about its lenses, one line each.
std::vector<std::string> realsense_lens_notes(const RealSenseHeader& header);

}  // namespace mr::sensor
