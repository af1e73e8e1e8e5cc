#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/sensor_config.h"
#include "mr/core/timeline.h"
#include "mr/sensor/ouster/range_camera.h"
#include "mr/sensor/recording_formats.h"
#include "mr/sensor/source_registry.h"

namespace mr::sensor {

/// Packets of an Ouster LiDAR in a capture file (pcap), and the sensor's metadata. Its colour is a
/// grey panorama that the LiDAR itself measures.
struct OusterPcapSource {
  static constexpr std::string_view kType = "ouster-pcap";

  std::filesystem::path file, metadata;
  GreySource texture = GreySource::near_ir;
  std::string sender;  ///< numeric address of the sensor, where several share a port; may be empty
  bool loop = false;   ///< start again after the last scan
  SourceClock recorded;  ///< by the first scan

  SourceContent content() const { return {0, loop}; }
  SourceClock clock() const { return recorded; }
  std::vector<std::filesystem::path> files() const { return {file, metadata}; }
  friend bool operator==(const OusterPcapSource&, const OusterPcapSource&) = default;
};

/// An Ouster LiDAR that sends its packets to this computer.
struct OusterLiveSource {
  static constexpr std::string_view kType = "ouster";

  std::filesystem::path metadata;
  GreySource texture = GreySource::near_ir;
  std::string sender;   ///< as above
  std::string address;  ///< numeric, of this computer; empty: all
  int port = 7502;

  static constexpr Range kPort{1, 65535};
  SourceContent content() const { return {}; }
  std::vector<std::string> problems() const;
  std::vector<std::filesystem::path> files() const { return {metadata}; }
  friend bool operator==(const OusterLiveSource&, const OusterLiveSource&) = default;
};

/// A frame is one turn: its exposure is the time from the first column to the last, by the sensor's
/// clock. Lost packets are columns without depth. Cameras are those of RangeCamera.
std::unique_ptr<FrameSource> open_ouster_pcap(const SensorConfig& sensor, SensorId id,
                                              const Timeline& timeline);
/// The same of a live sensor. Error io: no turn was completed for a second.
std::unique_ptr<FrameSource> open_ouster_live(const SensorConfig& sensor, SensorId id,
                                              const Timeline& timeline);

/// The keys file, metadata, texture, sender and loop.
SourceKeys read_ouster_pcap(yaml::MapReader& map, const std::string& key);
/// The keys metadata, texture, sender, address and port.
SourceKeys read_ouster_live(yaml::MapReader& map, const std::string& key);

/// For the registry of formats: files named .pcap or .pcapng. Their metadata is a .json of the same
/// name, or the only one in the folder that fits.
bool is_ouster_pcap(const std::filesystem::path& path);
Result<RecordingInfo> describe_ouster_pcap(const std::filesystem::path& path);
Result<ImportedScene> import_ouster_pcap(const std::filesystem::path& path);
/// The same for a sensor's metadata (.json), which makes no scene by itself.
bool is_ouster_metadata(const std::filesystem::path& path);
Result<RecordingInfo> describe_ouster_metadata(const std::filesystem::path& path);

}  // namespace mr::sensor
