#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/evp.h>

#include <filesystem>
#include <map>
#include <regex>

#include "mr/core/file.h"
#include "mr/sensor/ouster/lidar_scan.h"
#include "mr/sensor/ouster/udp_capture.h"
#include "support/ouster_packets.h"
#include "support/shared_data.h"

namespace mr::sensor::ouster_scan_test {
namespace {

using test::Bytes;
using test::lidar_packet;

/// Every pixel differs from its neighbours.
LidarPixel numbered(int column, int row) {
  return {.range_mm = static_cast<std::uint32_t>(1000 + column * 16 + row),
          .near_ir = static_cast<std::uint16_t>(column),
          .reflectivity = static_cast<std::uint8_t>(row)};
}

/// Packet i of a turn.
Bytes packet_of(const OusterMetadata& metadata, std::uint32_t frame_id, int packet) {
  return lidar_packet(metadata, {.frame_id = frame_id, .first_column = packet * 16}, numbered);
}

constexpr int kPackets = 32;  ///< of a turn of 512 columns

TEST(OusterScan, ATurnOfPacketsIsAScan) {
  const auto metadata = test::ouster_metadata({});
  ScanAssembler assembler(metadata);
  for (int i = 0; i < kPackets - 1; ++i)
    ASSERT_FALSE(assembler.accept(packet_of(metadata, 7, i)).has_value());
  const auto scan = assembler.accept(packet_of(metadata, 7, kPackets - 1));
  ASSERT_TRUE(scan.has_value()) << "the last column completes it";
  EXPECT_EQ(scan->frame_id, 7u);
  EXPECT_EQ(scan->valid_columns(), 512);
  EXPECT_EQ(scan->width(), 512);
  EXPECT_EQ(scan->height(), 16);
  EXPECT_EQ(*scan->first.range_mm.at(100, 9), 1000u + 1600 + 9);
  EXPECT_EQ(*scan->near_ir.at(511, 0), 511);
  EXPECT_EQ(*scan->first.reflectivity.at(0, 15), 15);
  EXPECT_EQ(scan->timestamp_ns[300], 1'000'300'000u);
  EXPECT_EQ(scan->status[300], 1u);
  EXPECT_TRUE(scan->second.range_mm.empty());
  EXPECT_FALSE(assembler.flush().has_value());
}

TEST(OusterScan, SecondReturnsHaveTheirOwnPictures) {
  const auto metadata = test::ouster_metadata({.profile = "RNG19_RFL8_SIG16_NIR16_DUAL"});
  const auto scan = test::lidar_scan(metadata, [](int column, int row) {
    return LidarPixel{.range_mm = static_cast<std::uint32_t>(column + 1),
                      .range2_mm = static_cast<std::uint32_t>(10000 + row),
                      .signal = 5,
                      .signal2 = 6,
                      .near_ir = 7,
                      .reflectivity = 8,
                      .reflectivity2 = 9};
  });
  EXPECT_EQ(*scan.first.range_mm.at(70, 3), 71u);
  EXPECT_EQ(*scan.second.range_mm.at(70, 3), 10003u);
  EXPECT_EQ(*scan.second.signal.at(70, 3), 6);
  EXPECT_EQ(*scan.second.reflectivity.at(70, 3), 9);
  EXPECT_EQ(*scan.near_ir.at(70, 3), 7);
}

TEST(OusterScan, LostPacketsLeaveHolesAndShiftNothing) {
  const auto metadata = test::ouster_metadata({});
  ScanAssembler assembler(metadata);
  for (int i = 0; i < kPackets; ++i)
    if (i != 0 && i != 5) {
      ASSERT_FALSE(assembler.accept(packet_of(metadata, 1, i)).has_value());
    }
  const auto scan = assembler.accept(packet_of(metadata, 2, 0));
  ASSERT_TRUE(scan.has_value()) << "a later frame ends it";
  EXPECT_EQ(scan->frame_id, 1u);
  EXPECT_EQ(scan->valid_columns(), 512 - 32);
  for (const int column : {0, 15, 80, 95}) {
    EXPECT_EQ(scan->valid[static_cast<std::size_t>(column)], 0);
    EXPECT_EQ(*scan->first.range_mm.at(column, 3), 0u);
    EXPECT_EQ(*scan->near_ir.at(column, 3), 0);
  }
  for (const int column : {16, 79, 96, 511})
    EXPECT_EQ(*scan->first.range_mm.at(column, 3), 1003u + static_cast<unsigned>(column) * 16);
}

TEST(OusterScan, PacketsOfAScanMayComeInAnyOrderAndTwice) {
  const auto metadata = test::ouster_metadata({});
  ScanAssembler assembler(metadata);
  std::optional<LidarScan> scan;
  for (int i = 0; i < kPackets; ++i) {
    const Bytes packet = packet_of(metadata, 1, i * 7 % kPackets);
    ASSERT_FALSE(scan.has_value());
    scan = assembler.accept(packet);
    if (i + 1 < kPackets) {
      ASSERT_FALSE(assembler.accept(packet).has_value());
    }
  }
  ASSERT_TRUE(scan.has_value());
  EXPECT_EQ(scan->first.range_mm, test::lidar_scan(metadata, numbered).first.range_mm);
}

TEST(OusterScan, LatePacketsStartNoScan) {
  const auto metadata = test::ouster_metadata({});
  ScanAssembler assembler(metadata);
  for (int i = 0; i < kPackets - 1; ++i) assembler.accept(packet_of(metadata, 65535, i));
  auto scan = assembler.accept(packet_of(metadata, 0, 0));  // 65535 wraps around
  ASSERT_TRUE(scan.has_value());
  EXPECT_EQ(scan->frame_id, 65535u);
  EXPECT_FALSE(assembler.accept(packet_of(metadata, 65535, kPackets - 1)).has_value());
  EXPECT_EQ(assembler.counts().late, 1u);
  for (int i = 1; i < kPackets; ++i) scan = assembler.accept(packet_of(metadata, 0, i));
  ASSERT_TRUE(scan.has_value());
  EXPECT_EQ(scan->frame_id, 0u);
  EXPECT_EQ(scan->valid_columns(), 512);
  EXPECT_FALSE(assembler.accept(packet_of(metadata, 0, 3)).has_value());
  EXPECT_EQ(assembler.counts().late, 2u);
  EXPECT_FALSE(assembler.flush().has_value());
}

TEST(OusterScan, ASensorThatStartsAnewIsFollowed) {
  const auto metadata = test::ouster_metadata({});
  ScanAssembler assembler(metadata);
  assembler.accept(packet_of(metadata, 5000, 0));
  const auto scan = assembler.accept(packet_of(metadata, 1, 0));
  ASSERT_TRUE(scan.has_value());
  EXPECT_EQ(scan->frame_id, 5000u);
  EXPECT_EQ(assembler.flush()->frame_id, 1u);
}

TEST(OusterScan, WideFrameIdsWrapAt32Bits) {
  const auto metadata = test::ouster_metadata({.profile = "FUSA_RNG15_RFL8_NIR8_DUAL"});
  ScanAssembler assembler(metadata);
  assembler.accept(packet_of(metadata, 0xFFFF, 0));
  EXPECT_TRUE(assembler.accept(packet_of(metadata, 0x10000, 0)).has_value());
  assembler.accept(packet_of(metadata, 0xFFFFFFFF, 0));
  EXPECT_EQ(assembler.accept(packet_of(metadata, 0, 0))->frame_id, 0xFFFFFFFFu);
}

TEST(OusterScan, AWindowIsCompleteWithoutTheOtherColumns) {
  const auto metadata = test::ouster_metadata({.window_first = 500, .window_last = 11});
  ScanAssembler assembler(metadata);
  EXPECT_FALSE(assembler.accept(packet_of(metadata, 1, 31)).has_value());
  const auto scan = assembler.accept(packet_of(metadata, 1, 0));
  ASSERT_TRUE(scan.has_value());
  EXPECT_EQ(scan->valid[500], 1);
  EXPECT_EQ(scan->valid[11], 1);
  EXPECT_EQ(scan->valid[100], 0);
}

TEST(OusterScan, InvalidColumnsCountAsReceivedAndStayEmpty) {
  const auto metadata = test::ouster_metadata({});
  ScanAssembler assembler(metadata);
  std::optional<LidarScan> scan;
  for (int i = 0; i < kPackets; ++i)
    scan = assembler.accept(
        lidar_packet(metadata, {.frame_id = 1, .first_column = i * 16, .valid = i != 4}, numbered));
  ASSERT_TRUE(scan.has_value());
  EXPECT_EQ(scan->valid_columns(), 512 - 16);
  EXPECT_EQ(*scan->first.range_mm.at(64, 0), 0u);
}

TEST(OusterScan, ColumnsBeyondThePictureAreIgnored) {
  const auto metadata = test::ouster_metadata({});
  ScanAssembler assembler(metadata);
  assembler.accept(lidar_packet(metadata, {.frame_id = 1, .first_column = 504}, numbered));
  assembler.accept(lidar_packet(metadata, {.frame_id = 1, .first_column = 60000}, numbered));
  EXPECT_EQ(assembler.flush()->valid_columns(), 8);
}

TEST(OusterScan, PacketsOfOtherSensorsAndSizesAreCounted) {
  const auto metadata = test::ouster_metadata({});
  ScanAssembler assembler(metadata);
  assembler.accept(Bytes(48));  // IMU
  assembler.accept({});
  assembler.accept(lidar_packet(metadata, {.frame_id = 9, .serial = 1}, numbered));
  assembler.accept(lidar_packet(metadata, {.frame_id = 9, .init_id = 1}, numbered));
  EXPECT_FALSE(assembler.flush().has_value());
  assembler.accept(lidar_packet(metadata, {.frame_id = 3, .init_id = 0, .serial = 0}, numbered));
  EXPECT_EQ(assembler.counts().other_size, 2u);
  EXPECT_EQ(assembler.counts().foreign, 2u);
  EXPECT_EQ(assembler.counts().accepted, 1u);
  EXPECT_EQ(assembler.flush()->frame_id, 3u);
}

TEST(OusterScan, TwoSensorsOnOnePortAreToldApart) {
  const auto a = test::ouster_metadata({}), b = test::ouster_metadata({.serial = "1234"});
  ScanAssembler of_a(a), of_b(b);
  int scans_a = 0, scans_b = 0;
  for (int i = 0; i < kPackets; ++i)
    for (const std::uint64_t serial : {std::uint64_t{122201000998}, std::uint64_t{1234}}) {
      const Bytes packet = lidar_packet(
          a, {.frame_id = serial == 1234 ? 700u : 3u, .first_column = i * 16, .serial = serial},
          numbered);
      scans_a += of_a.accept(packet).has_value();
      scans_b += of_b.accept(packet).has_value();
    }
  EXPECT_EQ(scans_a, 1);
  EXPECT_EQ(scans_b, 1);
  EXPECT_EQ(of_a.counts().foreign, static_cast<std::uint64_t>(kPackets));
}

TEST(OusterScan, LegacySensorsAreToldApartByAddress) {
  const auto metadata = test::ouster_metadata({.profile = "LEGACY"});
  const IpAddress first = *parse_ip_address("192.168.1.10"), other = *parse_ip_address("fe80::1");
  ScanAssembler by_first(metadata), by_address(metadata, other);
  for (int i = 0; i < 3; ++i) {
    by_first.accept(packet_of(metadata, 5, i), first);
    by_address.accept(packet_of(metadata, 5, i), first);
    by_first.accept(packet_of(metadata, 90, i), other);
    by_address.accept(packet_of(metadata, 90, i), other);
  }
  EXPECT_EQ(by_first.flush()->frame_id, 5u);
  EXPECT_EQ(by_address.flush()->frame_id, 90u);
  EXPECT_EQ(by_first.counts().foreign, 3u);
}

TEST(OusterScan, DestaggeringRollsEachRow) {
  const auto metadata = test::ouster_metadata({.azimuth_deg = 3});
  ASSERT_EQ(metadata.pixel_shift_by_row[0], 4);
  ASSERT_EQ(metadata.pixel_shift_by_row[3], -4);
  Image<std::uint32_t, 1> staggered(512, 16);
  for (int row = 0; row < 16; ++row)
    for (int x = 0; x < 512; ++x) *staggered.at(x, row) = static_cast<std::uint32_t>(x);
  const auto straight = destagger(metadata, staggered);
  for (int row = 0; row < 4; ++row)
    for (int x = 0; x < 512; ++x) {
      const int to = (x + metadata.pixel_shift_by_row[static_cast<std::size_t>(row)] + 512) % 512;
      ASSERT_EQ(*straight.at(to, row), static_cast<std::uint32_t>(x));
    }
}

TEST(OusterScan, PointsAtRangeZeroLieAtTheLidarsCentre) {
  // With B[2][3] = 0 and n subtracted, a range of n reaches the beam's origin, and the directions
  // follow the encoder: column 0 looks to the lidar's +x, which is behind the sensor.
  const auto metadata = test::ouster_metadata({.top_deg = 0, .bottom_deg = -45, .origin_mm = 16});
  const Vec3d origin = ouster_point(metadata, 0, 0, 16);
  EXPECT_NEAR(origin.x, -0.016, 1e-12);
  EXPECT_NEAR(origin.z, 0.03618, 1e-12);
  const Vec3d behind = ouster_point(metadata, 0, 0, 2000);
  EXPECT_NEAR(behind.x, -2, 1e-9);
  const Vec3d quarter = ouster_point(metadata, 0, 128, 2000);  // clockwise from behind: left
  EXPECT_NEAR(quarter.y, 2, 1e-9);
  EXPECT_NEAR(quarter.x, 0, 1e-9);
}

// Recordings ------------------------------------------------------------------------------------

std::filesystem::path recordings() { return test::shared_data() / "ouster"; }

struct Recording {
  OusterMetadata metadata;
  std::vector<LidarScan> scans;
  ScanAssembler::Counts counts;
};

std::optional<Recording> read_recording(const std::string& json, const std::string& pcap) {
  const auto metadata = read_ouster_metadata(recordings() / json);
  auto reader = PcapReader::open(recordings() / pcap);
  if (!metadata || !reader) return std::nullopt;
  Recording out{*metadata, {}, {}};
  ScanAssembler assembler(*metadata);
  for (auto datagram = reader->next(); datagram && *datagram; datagram = reader->next())
    if (auto scan = assembler.accept((*datagram)->payload, (*datagram)->from.address))
      out.scans.push_back(std::move(*scan));
  if (auto scan = assembler.flush()) out.scans.push_back(std::move(*scan));
  out.counts = assembler.counts();
  return out;
}

#define SKIP_WITHOUT_OUSTER_RECORDINGS()      \
  if (!std::filesystem::exists(recordings())) \
  GTEST_SKIP() << "no recordings at " << recordings() << " (set MR_DATA)"

template <typename T>
std::string md5_of(const Image<T, 1>& image) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  EXPECT_EQ(EVP_Digest(image.data.data(), image.data.size() * sizeof(T), digest, &size, EVP_md5(),
                       nullptr),
            1);
  std::string out;
  for (unsigned i = 0; i < size; ++i) {
    char hex[3];
    std::snprintf(hex, sizeof hex, "%02x", digest[i]);
    out += hex;
  }
  return out;
}

/// The digests of the first scan by field name.
std::map<std::string, std::string> vendor_digests(const std::string& file) {
  const auto bytes = read_file(recordings() / file);
  EXPECT_TRUE(bytes.ok());
  std::string text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  text = text.substr(text.find("\"scans\""));
  std::map<std::string, std::string> out;
  const std::regex entry("\"([A-Z_]+)\": \"([0-9a-f]+)\"");
  for (std::sregex_iterator at(text.begin(), text.end(), entry), end; at != end; ++at)
    out.emplace((*at)[1], (*at)[2]);
  return out;
}

TEST(OusterRecordings, PicturesHaveTheVendorsDigests) {
  SKIP_WITHOUT_OUSTER_RECORDINGS();
  for (const std::string name :
       {"OS-1-32-G_v2.1.1_1024x10", "OS-2-128-U1_v2.3.0_1024x10", "OS-2-32-U0_v2.0.0_1024x10"}) {
    SCOPED_TRACE(name);
    const auto recording = read_recording(name + ".json", name + ".pcap");
    ASSERT_TRUE(recording.has_value());
    ASSERT_EQ(recording->scans.size(), 1u);
    EXPECT_EQ(recording->counts.accepted, 64u);
    EXPECT_EQ(recording->counts.foreign + recording->counts.late, 0u);
    const LidarScan& scan = recording->scans[0];
    auto digests = vendor_digests(name + "_digest.json");
    EXPECT_EQ(std::to_string(scan.frame_id), digests["FRAME_ID"]);
    EXPECT_EQ(md5_of(scan.first.range_mm), digests["RANGE"]);
    EXPECT_EQ(md5_of(scan.near_ir), digests["NEAR_IR"]);
    EXPECT_EQ(md5_of(scan.first.reflectivity), digests["REFLECTIVITY"]);
    EXPECT_EQ(md5_of(scan.first.signal), digests["SIGNAL"]);
    EXPECT_EQ(scan.valid_columns(), 1024);
  }
}

TEST(OusterRecordings, AnOs1OfThreeTurnsGivesThreeScans) {
  SKIP_WITHOUT_OUSTER_RECORDINGS();
  const auto recording =
      read_recording("OS-1-128_v2.3.0_1024x10.json", "OS-1-128_v2.3.0_1024x10_lb_n3.pcap");
  ASSERT_TRUE(recording.has_value());
  EXPECT_EQ(recording->counts.accepted, 192u);
  EXPECT_EQ(recording->counts.other_size, 30u);  // IMU
  ASSERT_EQ(recording->scans.size(), 3u);
  std::uint32_t frame_id = 1795;
  for (const LidarScan& scan : recording->scans) {
    EXPECT_EQ(scan.frame_id, frame_id++);
    EXPECT_EQ(scan.valid_columns(), 1024);
    EXPECT_TRUE(scan.first.signal.empty());
  }
}

TEST(OusterRecordings, PointsHaveTheVendorsCoordinates) {
  SKIP_WITHOUT_OUSTER_RECORDINGS();
  const auto recording =
      read_recording("OS-2-128-U1_v2.3.0_1024x10.json", "OS-2-128-U1_v2.3.0_1024x10.pcap");
  ASSERT_TRUE(recording.has_value() && recording->scans.size() == 1);
  const auto expect_point = [&](int row, int column, std::uint32_t range_mm, Vec3d mm) {
    EXPECT_EQ(*recording->scans[0].first.range_mm.at(column, row), range_mm);
    const Vec3d p = ouster_point(recording->metadata, row, column, range_mm) * 1000;
    EXPECT_NEAR(p.x, mm.x, 2e-3);
    EXPECT_NEAR(p.y, mm.y, 2e-3);
    EXPECT_NEAR(p.z, mm.z, 2e-3);
  };
  expect_point(64, 512, 50971, {50937.263, -1840.581, -144.046});
  expect_point(10, 100, 20154, {-16411.460, 11256.837, 3260.166});
}

}  // namespace
}  // namespace mr::sensor::ouster_scan_test
