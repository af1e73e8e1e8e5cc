#include <gtest/gtest.h>

#include "mr/sensor/ouster/packet_format.h"
#include "support/ouster_packets.h"

namespace mr::sensor::ouster_packets_test {
namespace {

constexpr LidarProfile kAllProfiles[] = {
    LidarProfile::legacy,
    LidarProfile::rng19_rfl8_sig16_nir16,
    LidarProfile::rng19_rfl8_sig16_nir16_dual,
    LidarProfile::rng15_rfl8_nir8,
    LidarProfile::rng15_rfl8_nir8_dual,
    LidarProfile::fusa_rng15_rfl8_nir8_dual,
};

OusterMetadata metadata_of(LidarProfile profile) {
  return test::ouster_metadata({.profile = std::string(profile_name(profile))});
}

TEST(OusterPackets, SizesOfAllProfiles) {
  const auto bytes = [](LidarProfile profile, int rows) {
    return packet_format(profile, 16, rows).packet_bytes();
  };
  EXPECT_EQ(bytes(LidarProfile::legacy, 32), 6464u);
  EXPECT_EQ(bytes(LidarProfile::legacy, 64), 12608u);
  EXPECT_EQ(bytes(LidarProfile::legacy, 128), 24896u);
  EXPECT_EQ(bytes(LidarProfile::rng19_rfl8_sig16_nir16, 128), 24832u);
  EXPECT_EQ(bytes(LidarProfile::rng19_rfl8_sig16_nir16_dual, 128), 33024u);
  EXPECT_EQ(bytes(LidarProfile::rng15_rfl8_nir8, 128), 8448u);
  EXPECT_EQ(bytes(LidarProfile::rng15_rfl8_nir8_dual, 128), 16640u);
  EXPECT_EQ(bytes(LidarProfile::fusa_rng15_rfl8_nir8_dual, 128), 16640u);
}

TEST(OusterPackets, NamesAreUniqueAndFound) {
  for (const LidarProfile profile : kAllProfiles)
    EXPECT_EQ(profile_named(profile_name(profile)), profile);
  EXPECT_FALSE(profile_named("").has_value());
  EXPECT_FALSE(profile_named("RNG19").has_value());
}

/// What a profile can hold of a pixel.
LidarPixel rounded(LidarPixel pixel, LidarProfile profile) {
  if (!has_signal(profile)) {
    pixel.range_mm = pixel.range_mm / 8 * 8;
    pixel.range2_mm = pixel.range2_mm / 8 * 8;
    pixel.near_ir = static_cast<std::uint16_t>(pixel.near_ir / 16 % 256 * 16);
    pixel.signal = pixel.signal2 = 0;
  }
  if (!has_second_return(profile)) pixel.range2_mm = pixel.signal2 = pixel.reflectivity2 = 0;
  return pixel;
}

void expect_same(const LidarPixel& a, const LidarPixel& b) {
  EXPECT_EQ(a.range_mm, b.range_mm);
  EXPECT_EQ(a.range2_mm, b.range2_mm);
  EXPECT_EQ(a.reflectivity, b.reflectivity);
  EXPECT_EQ(a.reflectivity2, b.reflectivity2);
  EXPECT_EQ(a.signal, b.signal);
  EXPECT_EQ(a.signal2, b.signal2);
  EXPECT_EQ(a.near_ir, b.near_ir);
}

std::uint32_t longest_mm(LidarProfile profile) {
  if (profile == LidarProfile::legacy) return 0xFFFFF;
  return has_signal(profile) ? 0x7FFFF : 0x7FFF * 8;
}

/// Each value alone at its limit, amid unused bits that are all 0 or all 1.
TEST(OusterPackets, EveryFieldHasItsOwnBits) {
  for (const LidarProfile profile : kAllProfiles) {
    SCOPED_TRACE(profile_name(profile));
    const OusterMetadata metadata = metadata_of(profile);
    const std::uint32_t most_mm = longest_mm(profile);
    const LidarPixel pixels[] = {{},
                                 {.range_mm = most_mm},
                                 {.range2_mm = most_mm},
                                 {.signal = 0xFFFF},
                                 {.signal2 = 0xFFFF},
                                 {.near_ir = 0xFFFF},
                                 {.reflectivity = 0xFF},
                                 {.reflectivity2 = 0xFF},
                                 {.range_mm = 8,
                                  .range2_mm = 16,
                                  .signal = 1,
                                  .signal2 = 2,
                                  .near_ir = 16,
                                  .reflectivity = 3,
                                  .reflectivity2 = 4}};
    for (const std::uint8_t unused : {0, 0xFF})
      for (const LidarPixel& pixel : pixels) {
        const auto bytes =
            test::lidar_packet(metadata, {.unused = unused}, [&](int, int) { return pixel; });
        const auto packet = LidarPacket::view(metadata.packet_format(), bytes);
        ASSERT_TRUE(packet.has_value());
        expect_same(packet->pixel(0, 0), rounded(pixel, profile));
        expect_same(packet->pixel(15, 15), rounded(pixel, profile));
      }
  }
}

TEST(OusterPackets, PixelsComeFromTheirColumnAndRow) {
  for (const LidarProfile profile : kAllProfiles) {
    SCOPED_TRACE(profile_name(profile));
    const OusterMetadata metadata = metadata_of(profile);
    const auto pixel = [](int column, int row) {
      return LidarPixel{.range_mm = static_cast<std::uint32_t>(column * 128 + row * 8),
                        .reflectivity = static_cast<std::uint8_t>(column + row)};
    };
    const auto bytes = test::lidar_packet(metadata, {.first_column = 496}, pixel);
    const auto packet = LidarPacket::view(metadata.packet_format(), bytes);
    ASSERT_TRUE(packet.has_value());
    for (int c = 0; c < 16; ++c) {
      EXPECT_EQ(packet->column(c).measurement_id, 496 + c);
      EXPECT_EQ(packet->column(c).timestamp_ns, 1'000'496'000u + static_cast<unsigned>(c) * 1000);
      for (int row = 0; row < 16; ++row) expect_same(packet->pixel(c, row), pixel(496 + c, row));
    }
  }
}

TEST(OusterPackets, HeadersSayFrameSensorAndStatus) {
  for (const LidarProfile profile : kAllProfiles) {
    SCOPED_TRACE(profile_name(profile));
    const OusterMetadata metadata = metadata_of(profile);
    const std::uint32_t frame_id = has_wide_frame_id(profile) ? 0xFEDCBA98 : 0xFEDC;
    const auto bytes = test::lidar_packet(
        metadata,
        {.frame_id = frame_id, .init_id = 0xABCDEF, .serial = 0x123456789A, .valid = false},
        [](int, int) { return LidarPixel{}; });
    const auto packet = LidarPacket::view(metadata.packet_format(), bytes);
    ASSERT_TRUE(packet.has_value());
    EXPECT_EQ(packet->frame_id(), frame_id);
    EXPECT_EQ(packet->column(3).frame_id, frame_id);
    EXPECT_FALSE(packet->column(3).valid);
    if (profile == LidarProfile::legacy) {
      EXPECT_FALSE(packet->init_id() || packet->serial());
    } else {
      EXPECT_EQ(packet->init_id(), 0xABCDEFu);
      EXPECT_EQ(packet->serial(), 0x123456789Au);
    }
  }
}

TEST(OusterPackets, OtherSizesAndKindsAreNoLidarPackets) {
  for (const LidarProfile profile : kAllProfiles) {
    const OusterMetadata metadata = metadata_of(profile);
    auto bytes = test::lidar_packet(metadata, {}, [](int, int) { return LidarPixel{}; });
    const PacketFormat format = metadata.packet_format();
    EXPECT_FALSE(LidarPacket::view(format, {}).has_value());
    EXPECT_FALSE(LidarPacket::view(format, std::span(bytes).first(bytes.size() - 1)).has_value());
    if (profile == LidarProfile::legacy) continue;
    bytes[0] = std::byte{2};
    EXPECT_FALSE(LidarPacket::view(format, bytes).has_value());
    bytes.push_back(std::byte{0});
    EXPECT_FALSE(LidarPacket::view(format, bytes).has_value());
  }
}

}  // namespace
}  // namespace mr::sensor::ouster_packets_test
