#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace mr::sensor {

/// How the pixels of an Ouster lidar packet are coded; names as in the sensor's
/// `udp_profile_lidar`.
enum class LidarProfile {
  legacy,
  rng19_rfl8_sig16_nir16,
  rng19_rfl8_sig16_nir16_dual,
  rng15_rfl8_nir8,
  rng15_rfl8_nir8_dual,
  fusa_rng15_rfl8_nir8_dual  ///< functional safety: another header, 32-bit frame ids
};

/// "RNG19_RFL8_SIG16_NIR16", …
std::string_view profile_name(LidarProfile profile);
std::optional<LidarProfile> profile_named(std::string_view name);

bool has_second_return(LidarProfile profile);
bool has_signal(LidarProfile profile);
bool has_wide_frame_id(LidarProfile profile);  ///< 32 bits, not 16

/// Layout of a lidar packet: header, columns (each a header, one block per pixel, a footer),
/// footer. Little endian. Source: the vendor's sensor documentation and SDK (BSD-3), `parsing.cpp`.
struct PacketFormat {
  LidarProfile profile = LidarProfile::legacy;
  int columns = 0;  ///< per packet
  int rows = 0;     ///< pixels of a column
  std::size_t header_bytes = 0, footer_bytes = 0;
  std::size_t column_header_bytes = 0, block_bytes = 0, column_footer_bytes = 0;

  std::size_t column_bytes() const {
    return column_header_bytes + block_bytes * static_cast<std::size_t>(rows) + column_footer_bytes;
  }
  std::size_t packet_bytes() const {
    return header_bytes + column_bytes() * static_cast<std::size_t>(columns) + footer_bytes;
  }
};

PacketFormat packet_format(LidarProfile profile, int columns_per_packet, int rows);

struct LidarColumn {
  std::uint64_t timestamp_ns = 0;
  std::uint32_t frame_id = 0;
  std::uint32_t status = 0;
  std::uint16_t measurement_id = 0;  ///< column of the picture; not checked against its width
  bool valid = false;
};

/// One pixel's measurement. Range 0: no return. What the profile lacks is 0.
struct LidarPixel {
  std::uint32_t range_mm = 0, range2_mm = 0;
  std::uint16_t signal = 0, signal2 = 0;
  std::uint16_t near_ir = 0;  ///< ambient light; measured without a return, too
  std::uint8_t reflectivity = 0, reflectivity2 = 0;
};

/// A lidar packet's bytes, seen through its format. Refers to the bytes; does not own them.
class LidarPacket {
 public:
  /// Nothing where the size is not exactly the format's, or the header says that it is a packet of
  /// another kind. The footer's CRC is not checked (old firmware does not write it; UDP has its
  /// own checksum).
  static std::optional<LidarPacket> view(const PacketFormat& format,
                                         std::span<const std::byte> bytes);

  std::uint32_t frame_id() const;
  std::optional<std::uint32_t> init_id() const;  ///< LEGACY has none
  std::optional<std::uint64_t> serial() const;   ///< LEGACY has none
  LidarColumn column(int column) const;          ///< column: 0 … format.columns - 1
  LidarPixel pixel(int column, int row) const;

 private:
  LidarPacket(const PacketFormat& format, std::span<const std::byte> bytes)
      : format_(format), bytes_(bytes) {}
  const std::byte* column_start(int column) const;

  PacketFormat format_;
  std::span<const std::byte> bytes_;
};

}  // namespace mr::sensor
