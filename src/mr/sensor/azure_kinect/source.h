#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/sensor_config.h"
#include "mr/core/timeline.h"
#include "mr/sensor/recording_formats.h"
#include "mr/sensor/source_registry.h"

namespace mr::sensor {

/// A recording of an Azure Kinect or Femto, read without an SDK. Cameras come from the recording.
struct KinectMkvSource {
  static constexpr std::string_view kType = "azure-kinect-mkv";

  std::filesystem::path file;
  std::filesystem::path calibration;  ///< in place of the recording's own; empty: its own
  bool loop = false;                  ///< start again after the last capture
  SourceClock recorded;               ///< by the file's header
  std::size_t captures = 0;           ///< by the file's header; 0: not known

  SourceContent content() const { return {captures, loop}; }
  SourceClock clock() const { return recorded; }
  std::vector<std::filesystem::path> files() const;
  friend bool operator==(const KinectMkvSource&, const KinectMkvSource&) = default;
};

/// Opens the source of a sensor, which must be a KinectMkvSource. Captures lie on the device's
/// clock, less a subordinate's delay. A capture whose depth is missing or damaged is lost; one
/// whose colour is comes without colour (Frame::color_lost).
std::unique_ptr<FrameSource> open_kinect_mkv(const SensorConfig& sensor, SensorId id,
                                             const Timeline& timeline);

/// The keys file, calibration and loop. Opens the recording for its cameras and its clock:
/// recordings that were synchronised by cable share one, others have a clock of their own.
SourceKeys read_kinect_mkv(yaml::MapReader& map, const std::string& key);

/// For the registry of formats: files named .mkv.
bool is_kinect_mkv(const std::filesystem::path& path);
Result<RecordingInfo> describe_kinect_mkv(const std::filesystem::path& path);
Result<ImportedScene> import_kinect_mkv(const std::filesystem::path& path);
/// The same for a device's calibration (.json), which makes no scene by itself.
bool is_kinect_calibration(const std::filesystem::path& path);
Result<RecordingInfo> describe_kinect_calibration(const std::filesystem::path& path);

struct KinectHeader;
/// The cameras of a recording: by the calibration in `calibration`, or where that is empty by its
/// own. Errors name the recording's `file`.
Result<SourceCameras> kinect_cameras(const KinectHeader& header, const std::filesystem::path& file,
                                     const std::filesystem::path& calibration);

}  // namespace mr::sensor
