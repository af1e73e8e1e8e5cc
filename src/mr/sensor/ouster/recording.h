#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/sensor/ouster/lidar_scan.h"
#include "mr/sensor/ouster/udp_capture.h"

namespace mr::sensor {

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

/// A sender as a scene file names it: a numeric address; empty: any.
Result<std::optional<IpAddress>> sender_address(const std::string& sender);

}  // namespace mr::sensor
