#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/sensor/ouster/lidar_scan.h"

/// Writes what an Ouster sensor sends: its metadata, lidar packets, and captures of them.
namespace mr::test {

using Bytes = std::vector<std::byte>;

struct OusterJson {
  std::string product = "OS-1-16", serial = "122201000998", profile = "RNG19_RFL8_SIG16_NIR16";
  int init_id = 7109750;
  int width = 512, height = 16, columns_per_packet = 16;
  int window_first = 0, window_last = 511;
  double top_deg = 22.5, bottom_deg = -22.5;
  double azimuth_deg = 0;  ///< rows have 1, 1/3, -1/3, -1 of it, again and again
  double origin_mm = 15.806, origin_up_mm = 0;
  double lift_mm = 36.18;
};

inline double altitude_deg(const OusterJson& o, int row) {
  return o.height == 1 ? o.top_deg : o.top_deg + (o.bottom_deg - o.top_deg) * row / (o.height - 1);
}
inline double azimuth_deg(const OusterJson& o, int row) {
  return o.azimuth_deg * (1 - (row % 4) * 2.0 / 3);
}

/// Metadata in sections, as of firmware 2.2 and later.
inline std::string ouster_json(const OusterJson& o) {
  std::string altitudes, azimuths, shifts;
  for (int row = 0; row < o.height; ++row) {
    const std::string comma = row > 0 ? "," : "";
    altitudes += comma + std::to_string(altitude_deg(o, row));
    azimuths += comma + std::to_string(azimuth_deg(o, row));
    shifts += comma + std::to_string(std::lround(azimuth_deg(o, row) / 360 * o.width));
  }
  const auto text = [](const auto& value) { return std::to_string(value); };
  return R"({"sensor_info":{"prod_line":")" + o.product + R"(","prod_sn":")" + o.serial +
         R"(","build_rev":"v3.1.0","initialization_id":)" + text(o.init_id) +
         R"(},"config_params":{"lidar_mode":")" + text(o.width) + (o.width == 4096 ? "x5" : "x10") +
         R"(","udp_port_lidar":7502,"udp_port_imu":7503},"lidar_data_format":{"pixels_per_column":)" +
         text(o.height) + R"(,"columns_per_frame":)" + text(o.width) + R"(,"columns_per_packet":)" +
         text(o.columns_per_packet) + R"(,"column_window":[)" + text(o.window_first) + "," +
         text(o.window_last) + R"(],"pixel_shift_by_row":[)" + shifts +
         R"(],"udp_profile_lidar":")" + o.profile +
         R"("},"beam_intrinsics":{"beam_altitude_angles":[)" + altitudes +
         R"(],"beam_azimuth_angles":[)" + azimuths + R"(],"beam_to_lidar_transform":[1,0,0,)" +
         text(o.origin_mm) + ",0,1,0,0,0,0,1," + text(o.origin_up_mm) +
         R"(,0,0,0,1]},"lidar_intrinsics":{"lidar_to_sensor_transform":[-1,0,0,0,0,-1,0,0,0,0,1,)" +
         text(o.lift_mm) + R"(,0,0,0,1]}})";
}

inline sensor::OusterMetadata ouster_metadata(const OusterJson& o) {
  auto metadata = sensor::parse_ouster_metadata(ouster_json(o));
  if (!metadata) {
    std::fputs((metadata.error().message + "\n").c_str(), stderr);
    std::abort();
  }
  return *metadata;
}

/// Writes a number into bytes, little endian.
inline void put(Bytes& bytes, std::size_t at, int count, std::uint64_t value) {
  for (int i = 0; i < count; ++i)
    bytes.at(at + static_cast<std::size_t>(i)) = static_cast<std::byte>(value >> (8 * i));
}

/// Bits [first, first + count) of a pixel's block.
inline void put_bits(Bytes& bytes, std::size_t block, int first, int count, std::uint64_t value) {
  for (int i = 0; i < count; ++i) {
    const std::size_t at = block + static_cast<std::size_t>((first + i) / 8);
    const auto bit = static_cast<std::byte>(1 << ((first + i) % 8));
    if ((value >> i & 1) != 0)
      bytes.at(at) |= bit;
    else
      bytes.at(at) &= ~bit;
  }
}

/// The bits of a pixel, from the tables of the vendor's manual.
inline void put_pixel(Bytes& bytes, std::size_t at, sensor::LidarProfile profile,
                      const sensor::LidarPixel& pixel) {
  using sensor::LidarProfile;
  switch (profile) {
    case LidarProfile::legacy:
    case LidarProfile::rng19_rfl8_sig16_nir16:
      put_bits(bytes, at, 0, profile == LidarProfile::legacy ? 20 : 19, pixel.range_mm);
      put_bits(bytes, at, 32, 8, pixel.reflectivity);
      put_bits(bytes, at, 48, 16, pixel.signal);
      put_bits(bytes, at, 64, 16, pixel.near_ir);
      return;
    case LidarProfile::rng19_rfl8_sig16_nir16_dual:
      put_bits(bytes, at, 0, 19, pixel.range_mm);
      put_bits(bytes, at, 24, 8, pixel.reflectivity);
      put_bits(bytes, at, 32, 19, pixel.range2_mm);
      put_bits(bytes, at, 56, 8, pixel.reflectivity2);
      put_bits(bytes, at, 64, 16, pixel.signal);
      put_bits(bytes, at, 80, 16, pixel.signal2);
      put_bits(bytes, at, 96, 16, pixel.near_ir);
      return;
    case LidarProfile::rng15_rfl8_nir8_dual:
    case LidarProfile::fusa_rng15_rfl8_nir8_dual:
      put_bits(bytes, at, 32, 15, pixel.range2_mm / 8);
      put_bits(bytes, at, 48, 8, pixel.reflectivity2);
      [[fallthrough]];
    case LidarProfile::rng15_rfl8_nir8:
      put_bits(bytes, at, 0, 15, pixel.range_mm / 8);
      put_bits(bytes, at, 16, 8, pixel.reflectivity);
      put_bits(bytes, at, 24, 8, pixel.near_ir / 16);
      return;
  }
}

struct PacketText {
  std::uint32_t frame_id = 0;
  int first_column = 0;
  std::uint32_t init_id = 7109750;
  std::uint64_t serial = 122201000998;
  std::uint8_t unused = 0;  ///< what bits that mean nothing are filled with
  bool valid = true;
};

using PixelOf = std::function<sensor::LidarPixel(int column, int row)>;

/// A lidar packet. A column's time is its measurement id in microseconds plus one second.
inline Bytes lidar_packet(const sensor::OusterMetadata& metadata, const PacketText& text,
                          const PixelOf& pixel_of) {
  using sensor::LidarProfile;
  const bool legacy = metadata.profile == LidarProfile::legacy;
  const bool fusa = metadata.profile == LidarProfile::fusa_rng15_rfl8_nir8_dual;
  const sensor::PacketFormat format = metadata.packet_format();
  Bytes bytes(format.packet_bytes(), std::byte{text.unused});
  if (!legacy) {
    put(bytes, 0, fusa ? 1 : 2, 1);
    put(bytes, fusa ? 1 : 4, 3, text.init_id);
    put(bytes, fusa ? 4 : 2, fusa ? 4 : 2, text.frame_id);
    put(bytes, fusa ? 11 : 7, 5, text.serial);
  }
  for (int c = 0; c < format.columns; ++c) {
    const int id = text.first_column + c;
    const std::size_t at =
        format.header_bytes + format.column_bytes() * static_cast<std::size_t>(c);
    put(bytes, at, 8, 1'000'000'000u + static_cast<std::uint64_t>(id) * 1000);
    put(bytes, at + 8, 2, static_cast<std::uint64_t>(id));
    put(bytes, at + 10, 2, legacy ? text.frame_id : text.valid ? 1 : 0);
    if (legacy) put(bytes, at + format.column_bytes() - 4, 4, text.valid ? 0xFFFFFFFF : 0);
    for (int row = 0; row < format.rows; ++row)
      put_pixel(
          bytes,
          at + format.column_header_bytes + format.block_bytes * static_cast<std::size_t>(row),
          metadata.profile, pixel_of(id, row));
  }
  return bytes;
}

/// The scan of all packets of a turn.
inline sensor::LidarScan lidar_scan(const sensor::OusterMetadata& metadata, const PixelOf& pixel) {
  sensor::ScanAssembler assembler(metadata);
  std::optional<sensor::LidarScan> scan;
  for (int column = 0; column < metadata.width; column += metadata.columns_per_packet)
    if (auto finished = assembler.accept(
            lidar_packet(metadata, {.frame_id = 1, .first_column = column}, pixel)))
      scan = std::move(finished);
  return scan ? std::move(*scan) : assembler.flush().value();
}

inline void append(Bytes& to, const Bytes& bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}
inline void append_big16(Bytes& to, unsigned value) {
  to.push_back(static_cast<std::byte>(value >> 8));
  to.push_back(static_cast<std::byte>(value));
}

/// A UDP packet from port 40000, without a checksum.
inline Bytes udp_packet(std::span<const std::byte> payload, unsigned to_port = 7502) {
  Bytes out;
  append_big16(out, 40000);
  append_big16(out, to_port);
  append_big16(out, static_cast<unsigned>(payload.size()) + 8);
  append_big16(out, 0);
  out.insert(out.end(), payload.begin(), payload.end());
  return out;
}

struct Ipv4Text {
  unsigned id = 1;
  std::size_t offset = 0;
  bool more = false;
  std::uint8_t last_byte_of_sender = 10;  ///< 192.168.1.x
};

/// An IPv4 packet (or fragment) of UDP, to 192.168.1.2.
inline Bytes ipv4_packet(std::span<const std::byte> udp, const Ipv4Text& text = {}) {
  Bytes out{std::byte{0x45}, std::byte{0}};
  append_big16(out, static_cast<unsigned>(udp.size()) + 20);
  append_big16(out, text.id);
  append_big16(out, (text.more ? 0x2000u : 0u) | static_cast<unsigned>(text.offset / 8));
  for (const int byte : {64, 17, 0, 0, 192, 168, 1, int{text.last_byte_of_sender}, 192, 168, 1, 2})
    out.push_back(static_cast<std::byte>(byte));
  out.insert(out.end(), udp.begin(), udp.end());
  return out;
}

/// The fragments of a UDP packet, `most` bytes each (a multiple of 8).
inline std::vector<Bytes> ipv4_fragments(const Bytes& udp, std::size_t most, unsigned id,
                                         std::uint8_t sender = 10) {
  std::vector<Bytes> out;
  for (std::size_t at = 0; at < udp.size(); at += most) {
    const std::size_t count = std::min(most, udp.size() - at);
    out.push_back(ipv4_packet(
        std::span(udp).subspan(at, count),
        {.id = id, .offset = at, .more = at + count < udp.size(), .last_byte_of_sender = sender}));
  }
  return out;
}

/// An Ethernet frame of an IPv4 (or other) packet, behind so many VLAN tags.
inline Bytes ethernet(const Bytes& packet, int vlan_tags = 0, unsigned type = 0x0800) {
  Bytes out(12);
  for (int i = 0; i < vlan_tags; ++i) append_big16(out, 0x8100), append_big16(out, 5);
  append_big16(out, type);
  append(out, packet);
  return out;
}

/// A pcap file (microseconds, little endian) of frames; frame i is captured at 100 + i/10 seconds.
inline Bytes pcap_file(const std::vector<Bytes>& frames, std::uint32_t link = 1) {
  Bytes out(24);
  put(out, 0, 4, 0xA1B2C3D4);
  put(out, 4, 2, 2);
  put(out, 6, 2, 4);
  put(out, 16, 4, 262144);
  put(out, 20, 4, link);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Bytes header(16);
    put(header, 0, 4, 100 + i / 10);
    put(header, 4, 4, i % 10 * 100000);
    put(header, 8, 4, frames[i].size());
    put(header, 12, 4, frames[i].size());
    append(out, header);
    append(out, frames[i]);
  }
  return out;
}

}  // namespace mr::test
