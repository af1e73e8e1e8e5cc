#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/sensor/ouster/packet_format.h"

namespace mr::sensor {

/// What an Ouster sensor says of itself (its metadata JSON, which belongs to every recording).
struct OusterMetadata {
  std::string product;   ///< "OS-1-128"
  std::string serial;    ///< as written; may be empty
  std::string firmware;  ///< "v2.3.0"; may be empty
  std::string mode;      ///< "1024x10"

  std::optional<std::uint32_t> init_id;        ///< changes whenever the sensor starts anew
  std::optional<std::uint64_t> serial_number;  ///< `serial` as a number; none: not a number
  LidarProfile profile = LidarProfile::legacy;
  int width = 0;   ///< columns of a turn
  int height = 0;  ///< beams
  int columns_per_packet = 16;
  double rate_hz = 0;                        ///< turns a second
  int window_first = 0, window_last = 0;     ///< columns that are sent; first > last: over column 0
  std::vector<int> pixel_shift_by_row;       ///< [height] columns
  std::vector<double> beam_altitude_rad;     ///< [height] up is positive; row 0 is the highest
  std::vector<double> beam_azimuth_rad;      ///< [height]
  std::array<double, 16> beam_to_lidar{};    ///< row-major, millimetres
  Pose T_sensor_lidar;                       ///< lidar frame → sensor frame
  int udp_port_lidar = 0, udp_port_imu = 0;  ///< 0: not said

  /// Number of columns in the window.
  int window_columns() const { return (window_last - window_first + width) % width + 1; }
  bool in_window(int column) const {
    return (column - window_first + width) % width < window_columns();
  }
  PacketFormat packet_format() const {
    return sensor::packet_format(profile, columns_per_packet, height);
  }
};

/// Reads both generations of the JSON: in sections (firmware 2.2 and later) and flat ("legacy").
/// Keys that are not known are ignored; those that are missing have the vendor's defaults; the mode
/// is required. An Error names one field, what is wrong, and what is supported.
Result<OusterMetadata> parse_ouster_metadata(std::string_view json);

/// The same of a file; messages start with its name. too_large: above 1 MiB.
Result<OusterMetadata> read_ouster_metadata(const std::filesystem::path& file);

}  // namespace mr::sensor
