#include "mr/sensor/ouster/packet_format.h"

#include <array>

#include "mr/core/assert.h"

namespace mr::sensor {
namespace {

/// An unsigned little-endian number of some bytes.
template <int kBytes>
std::uint64_t little_endian_at(const std::byte* p) {
  std::uint64_t value = 0;
  for (int i = 0; i < kBytes; ++i) value |= std::to_integer<std::uint64_t>(p[i]) << (8 * i);
  return value;
}
std::uint8_t lidar_u8(const std::byte* p) { return std::to_integer<std::uint8_t>(*p); }
std::uint16_t lidar_u16(const std::byte* p) {
  return static_cast<std::uint16_t>(little_endian_at<2>(p));
}
std::uint32_t lidar_u32(const std::byte* p) {
  return static_cast<std::uint32_t>(little_endian_at<4>(p));
}

struct ProfileLayout {
  LidarProfile profile;
  std::string_view name;
  std::size_t block_bytes;
};
constexpr std::array<ProfileLayout, 6> kProfiles{{
    {LidarProfile::legacy, "LEGACY", 12},
    {LidarProfile::rng19_rfl8_sig16_nir16, "RNG19_RFL8_SIG16_NIR16", 12},
    {LidarProfile::rng19_rfl8_sig16_nir16_dual, "RNG19_RFL8_SIG16_NIR16_DUAL", 16},
    {LidarProfile::rng15_rfl8_nir8, "RNG15_RFL8_NIR8", 4},
    {LidarProfile::rng15_rfl8_nir8_dual, "RNG15_RFL8_NIR8_DUAL", 8},
    {LidarProfile::fusa_rng15_rfl8_nir8_dual, "FUSA_RNG15_RFL8_NIR8_DUAL", 8},
}};

constexpr std::uint32_t kRange15 = 0x7FFF, kRange19 = 0x7FFFF, kRange20 = 0xFFFFF;

/// Range in 8 mm steps, reflectivity, and near-IR in steps of 16.
LidarPixel low_data_rate_pixel(const std::byte* p) {
  LidarPixel out;
  out.range_mm = (lidar_u16(p) & kRange15) * 8;
  out.reflectivity = lidar_u8(p + 2);
  out.near_ir = static_cast<std::uint16_t>(lidar_u8(p + 3) * 16);
  return out;
}

LidarPixel low_data_rate_dual_pixel(const std::byte* p) {
  LidarPixel out = low_data_rate_pixel(p);
  out.range2_mm = (lidar_u16(p + 4) & kRange15) * 8;
  out.reflectivity2 = lidar_u8(p + 6);
  return out;
}

LidarPixel single_pixel(const std::byte* p, std::uint32_t range_mask) {
  LidarPixel out;
  out.range_mm = lidar_u32(p) & range_mask;
  out.reflectivity = lidar_u8(p + 4);
  out.signal = lidar_u16(p + 6);
  out.near_ir = lidar_u16(p + 8);
  return out;
}

LidarPixel dual_pixel(const std::byte* p) {
  LidarPixel out;
  out.range_mm = lidar_u32(p) & kRange19;
  out.reflectivity = lidar_u8(p + 3);
  out.range2_mm = lidar_u32(p + 4) & kRange19;
  out.reflectivity2 = lidar_u8(p + 7);
  out.signal = lidar_u16(p + 8);
  out.signal2 = lidar_u16(p + 10);
  out.near_ir = lidar_u16(p + 12);
  return out;
}

}  // namespace

std::string_view profile_name(LidarProfile profile) {
  return kProfiles[static_cast<std::size_t>(profile)].name;
}

std::optional<LidarProfile> profile_named(std::string_view name) {
  for (const ProfileLayout& layout : kProfiles)
    if (layout.name == name) return layout.profile;
  return std::nullopt;
}

bool has_second_return(LidarProfile profile) {
  return profile == LidarProfile::rng19_rfl8_sig16_nir16_dual ||
         profile == LidarProfile::rng15_rfl8_nir8_dual ||
         profile == LidarProfile::fusa_rng15_rfl8_nir8_dual;
}

bool has_signal(LidarProfile profile) {
  return profile == LidarProfile::legacy || profile == LidarProfile::rng19_rfl8_sig16_nir16 ||
         profile == LidarProfile::rng19_rfl8_sig16_nir16_dual;
}

bool has_wide_frame_id(LidarProfile profile) {
  return profile == LidarProfile::fusa_rng15_rfl8_nir8_dual;
}

PacketFormat packet_format(LidarProfile profile, int columns_per_packet, int rows) {
  MR_ASSERT(columns_per_packet > 0 && rows > 0);
  PacketFormat format;
  format.profile = profile;
  format.columns = columns_per_packet;
  format.rows = rows;
  format.block_bytes = kProfiles[static_cast<std::size_t>(profile)].block_bytes;
  if (profile == LidarProfile::legacy) {
    format.column_header_bytes = 16;
    format.column_footer_bytes = 4;
  } else {
    format.header_bytes = format.footer_bytes = 32;
    format.column_header_bytes = 12;
  }
  return format;
}

std::optional<LidarPacket> LidarPacket::view(const PacketFormat& format,
                                             std::span<const std::byte> bytes) {
  constexpr int kLidar = 1;
  if (bytes.size() != format.packet_bytes()) return std::nullopt;
  if (format.profile == LidarProfile::legacy) return LidarPacket(format, bytes);
  const int type = format.profile == LidarProfile::fusa_rng15_rfl8_nir8_dual
                       ? lidar_u8(bytes.data())
                       : lidar_u16(bytes.data());
  if (type != kLidar) return std::nullopt;
  return LidarPacket(format, bytes);
}

const std::byte* LidarPacket::column_start(int column) const {
  MR_ASSERT(column >= 0 && column < format_.columns);
  return bytes_.data() + format_.header_bytes +
         format_.column_bytes() * static_cast<std::size_t>(column);
}

std::uint32_t LidarPacket::frame_id() const {
  switch (format_.profile) {
    case LidarProfile::legacy:
      return lidar_u16(column_start(0) + 10);
    case LidarProfile::fusa_rng15_rfl8_nir8_dual:
      return lidar_u32(bytes_.data() + 4);
    default:
      return lidar_u16(bytes_.data() + 2);
  }
}

std::optional<std::uint32_t> LidarPacket::init_id() const {
  if (format_.profile == LidarProfile::legacy) return std::nullopt;
  const int at = format_.profile == LidarProfile::fusa_rng15_rfl8_nir8_dual ? 1 : 4;
  return static_cast<std::uint32_t>(little_endian_at<3>(bytes_.data() + at));
}

std::optional<std::uint64_t> LidarPacket::serial() const {
  if (format_.profile == LidarProfile::legacy) return std::nullopt;
  const int at = format_.profile == LidarProfile::fusa_rng15_rfl8_nir8_dual ? 11 : 7;
  return little_endian_at<5>(bytes_.data() + at);
}

LidarColumn LidarPacket::column(int column) const {
  const std::byte* const p = column_start(column);
  LidarColumn out;
  out.timestamp_ns = little_endian_at<8>(p);
  out.measurement_id = lidar_u16(p + 8);
  if (format_.profile == LidarProfile::legacy) {
    out.frame_id = lidar_u16(p + 10);
    out.status = lidar_u32(p + format_.column_bytes() - format_.column_footer_bytes);
    out.valid = out.status == 0xFFFFFFFF;
  } else {
    out.frame_id = frame_id();
    out.status = lidar_u16(p + 10);
    out.valid = (out.status & 1) != 0;
  }
  return out;
}

LidarPixel LidarPacket::pixel(int column, int row) const {
  MR_ASSERT(row >= 0 && row < format_.rows);
  const std::byte* const p = column_start(column) + format_.column_header_bytes +
                             format_.block_bytes * static_cast<std::size_t>(row);
  switch (format_.profile) {
    case LidarProfile::legacy:
      return single_pixel(p, kRange20);
    case LidarProfile::rng19_rfl8_sig16_nir16:
      return single_pixel(p, kRange19);
    case LidarProfile::rng19_rfl8_sig16_nir16_dual:
      return dual_pixel(p);
    case LidarProfile::rng15_rfl8_nir8:
      return low_data_rate_pixel(p);
    case LidarProfile::rng15_rfl8_nir8_dual:
    case LidarProfile::fusa_rng15_rfl8_nir8_dual:
      return low_data_rate_dual_pixel(p);
  }
  return {};
}

}  // namespace mr::sensor
