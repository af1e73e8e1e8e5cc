#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/sensor_config.h"
#include "mr/core/timeline.h"
#include "mr/sensor/ouster/range_camera.h"
#include "mr/sensor/ouster/udp_capture.h"
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

/// Whether a turn took another time than the metadata's mode says: in one line; else empty.
std::string turn_mismatch(const OusterMetadata& metadata, const LidarScan& scan);

/// When a scan began and ended, by its columns: the sensor's clock. A scan has a valid column.
struct ScanTime {
  TimePoint start{}, end{};
  TimePoint middle() const { return start + (end - start) / 2; }
};
ScanTime time_of(const LidarScan& scan);

/// Reads the scans of a capture file in order.
class OusterRecording {
 public:
  /// Errors name the file. `sender`: numeric, or empty.
  static Result<OusterRecording> open(const std::filesystem::path& file,
                                      const OusterMetadata& metadata, const std::string& sender);

  /// The next scan that has a valid column; nothing at the end. Error: the file is damaged from
  /// here on; the scan before it comes first.
  Result<std::optional<LidarScan>> next();

  const ScanAssembler::Counts& packets() const { return assembler_.counts(); }
  PcapReader::Counts datagrams() const { return reader_.counts(); }

 private:
  OusterRecording(PcapReader reader, ScanAssembler assembler)
      : reader_(std::move(reader)), assembler_(std::move(assembler)) {}

  PcapReader reader_;
  ScanAssembler assembler_;
  std::optional<Error> error_;  ///< to be told after the last scan
  bool ended_ = false;
};

}  // namespace mr::sensor
