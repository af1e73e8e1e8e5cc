#include "mr/sensor/ouster/metadata.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "core/temp_dir.h"
#include "support/ouster_packets.h"

namespace mr::sensor::ouster_metadata_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr double kDegree = std::numbers::pi / 180;

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? text : text.replace(at, what.size(), by);
}

TEST(OusterMetadata, ReadsTheGenerationInSections) {
  const auto m = parse_ouster_metadata(test::ouster_json({.product = "OS-0-16",
                                                          .width = 2048,
                                                          .height = 32,
                                                          .window_first = 1900,
                                                          .window_last = 99,
                                                          .azimuth_deg = 9,
                                                          .origin_mm = 27.67,
                                                          .origin_up_mm = 3}));
  ASSERT_TRUE(m.ok()) << m.error().message;
  EXPECT_EQ(m->product, "OS-0-16");
  EXPECT_EQ(m->serial, "122201000998");
  EXPECT_EQ(m->serial_number, 122201000998u);
  EXPECT_EQ(m->firmware, "v3.1.0");
  EXPECT_EQ(m->init_id, 7109750u);
  EXPECT_EQ(m->mode, "2048x10");
  EXPECT_EQ(m->rate_hz, 10);
  EXPECT_EQ(m->width, 2048);
  EXPECT_EQ(m->height, 32);
  EXPECT_EQ(m->columns_per_packet, 16);
  EXPECT_EQ(m->profile, LidarProfile::rng19_rfl8_sig16_nir16);
  EXPECT_EQ(m->udp_port_lidar, 7502);
  EXPECT_EQ(m->udp_port_imu, 7503);
  EXPECT_NEAR(m->beam_altitude_rad[0], 22.5 * kDegree, 1e-9);
  EXPECT_NEAR(m->beam_azimuth_rad[1], 3 * kDegree, 1e-9);
  EXPECT_EQ(m->pixel_shift_by_row[0], 51);
  EXPECT_EQ(m->beam_to_lidar[3], 27.67);
  EXPECT_EQ(m->beam_to_lidar[11], 3);
  EXPECT_NEAR(m->T_sensor_lidar.translation.z, 0.03618, 1e-9);
  EXPECT_EQ(m->T_sensor_lidar.rotation(0, 0), -1);
}

TEST(OusterMetadata, AWindowMayGoOverColumnZero) {
  const auto m = test::ouster_metadata({.window_first = 500, .window_last = 11});
  EXPECT_EQ(m.window_columns(), 24);
  EXPECT_TRUE(m.in_window(500) && m.in_window(511) && m.in_window(0) && m.in_window(11));
  EXPECT_FALSE(m.in_window(499) || m.in_window(12));
}

/// Firmware 1.12 knows neither data format nor transforms, and had the first generation's beams.
TEST(OusterMetadata, LegacyDefaultsStandInForMissingKeys) {
  const auto m = parse_ouster_metadata(R"({"lidar_mode": "512x20", "prod_line": "OS-1-64"})");
  ASSERT_TRUE(m.ok()) << m.error().message;
  EXPECT_EQ(m->profile, LidarProfile::legacy);
  EXPECT_EQ(m->width, 512);
  EXPECT_EQ(m->height, 64);
  EXPECT_EQ(m->rate_hz, 20);
  EXPECT_EQ(m->columns_per_packet, 16);
  EXPECT_EQ(m->window_columns(), 512);
  EXPECT_EQ(m->pixel_shift_by_row[4], 9);
  EXPECT_EQ(m->pixel_shift_by_row[7], 0);
  EXPECT_NEAR(m->beam_altitude_rad[1], 16.084 * kDegree, 1e-3 * kDegree);
  EXPECT_NEAR(m->beam_altitude_rad[63], -16.611 * kDegree, 1e-9);
  EXPECT_NEAR(m->beam_azimuth_rad[3], -3.164 * kDegree, 1e-9);
  EXPECT_EQ(m->beam_to_lidar[3], 15.806);
  EXPECT_EQ(m->beam_to_lidar[0], 1);
  EXPECT_NEAR(m->T_sensor_lidar.translation.z, 0.03618, 1e-12);
  EXPECT_FALSE(m->init_id.has_value());
  EXPECT_FALSE(m->serial_number.has_value());
  EXPECT_EQ(m->udp_port_lidar, 0);
}

TEST(OusterMetadata, TheBeamOriginFollowsTheProduct) {
  const auto origin_mm = [](const std::string& product) {
    const auto m =
        parse_ouster_metadata(R"({"lidar_mode":"1024x10","prod_line":")" + product + R"("})");
    return m ? m->beam_to_lidar[3] : -1;
  };
  EXPECT_EQ(origin_mm("OS-0-64"), 27.67);
  EXPECT_EQ(origin_mm("OS-1-64-G"), 15.806);
  EXPECT_EQ(origin_mm("OS-2-64"), 13.762);
  EXPECT_EQ(origin_mm("OS1"), 12.163);
  const auto given = parse_ouster_metadata(
      R"({"lidar_mode":"1024x10","prod_line":"OS-0-64","lidar_origin_to_beam_origin_mm":20.5})");
  ASSERT_TRUE(given.ok());
  EXPECT_EQ(given->beam_to_lidar[3], 20.5);
}

TEST(OusterMetadata, AnonymousSerialNumbersAreNone) {
  for (const std::string serial : {"", "000000000000", "OS-7", "12 34"}) {
    const auto m = parse_ouster_metadata(test::ouster_json({.serial = serial}));
    ASSERT_TRUE(m.ok());
    EXPECT_FALSE(m->serial_number.has_value()) << serial;
  }
}

std::string problem_of(const std::string& json) {
  const auto m = parse_ouster_metadata(json);
  EXPECT_FALSE(m.ok()) << json;
  return m ? "" : m.error().message;
}

TEST(OusterMetadata, ErrorsNameFieldProblemAndWhatIsSupported) {
  const std::string good = test::ouster_json({});
  const auto problem = [&](const std::string& what, const std::string& by) {
    const std::string message = problem_of(replaced(good, what, by));
    EXPECT_THAT(message, Not(HasSubstr("\n")));
    EXPECT_THAT(message, HasSubstr("Ouster metadata: "));
    return message;
  };
  EXPECT_THAT(problem("512x10", "4096x10"),
              AllOf(HasSubstr("config_params.lidar_mode '4096x10'"), HasSubstr("512x10, 512x20"),
                    HasSubstr("4096x5")));
  EXPECT_THAT(problem("\"lidar_mode\"", "\"mode\""),
              HasSubstr("config_params.lidar_mode is missing"));
  EXPECT_THAT(problem("RNG19_RFL8_SIG16_NIR16", "FIVE_WORD_PIXEL"),
              AllOf(HasSubstr("lidar_data_format.udp_profile_lidar 'FIVE_WORD_PIXEL'"),
                    HasSubstr("LEGACY, RNG19_RFL8_SIG16_NIR16,")));
  EXPECT_THAT(problem("\"columns_per_frame\":512", "\"columns_per_frame\":1024"),
              HasSubstr("columns_per_frame is 1024, but mode 512x10 has 512 columns"));
  EXPECT_THAT(problem("\"pixels_per_column\":16", "\"pixels_per_column\":17"),
              HasSubstr("pixel_shift_by_row must be a list of 17 numbers, not 16"));
  EXPECT_THAT(problem("\"pixels_per_column\":16", "\"pixels_per_column\":0"),
              HasSubstr("pixels_per_column must be an integer from 1 to"));
  EXPECT_THAT(problem("\"pixels_per_column\":16", "\"pixels_per_column\":1e1"),
              HasSubstr("must be an integer"));
  EXPECT_THAT(problem("\"columns_per_packet\":16", "\"columns_per_packet\":18446744073709551615"),
              HasSubstr("columns_per_packet must be an integer from 1 to 256"));
  EXPECT_THAT(problem("[0,511]", "[0,512]"), HasSubstr("column_window must be an integer"));
  EXPECT_THAT(problem("[0,511]", "[0]"), HasSubstr("column_window must be two columns"));
  EXPECT_THAT(problem("[22.500000,", "[90.1,"),
              HasSubstr("beam_altitude_angles must hold numbers"));
  EXPECT_THAT(problem("[22.500000,", "[null,"),
              HasSubstr("beam_altitude_angles must hold numbers"));
  EXPECT_THAT(problem("[22.500000,", "[1,2,"), HasSubstr("must be a list of 16 numbers, not 17"));
  EXPECT_THAT(problem("[-1,0,0,0,0,-1", "[1,0,0,0,0,-1"),
              HasSubstr("lidar_to_sensor_transform is not a rigid transform"));
  EXPECT_THAT(problem("\"122201000998\"", "7"), HasSubstr("sensor_info.prod_sn must be a text"));
  EXPECT_THAT(problem("7109750", "16777216"), HasSubstr("initialization_id must be an integer"));
  EXPECT_THAT(problem("beam_altitude_angles", "angles"), HasSubstr("16 beams have no default"));
}

TEST(OusterMetadata, RefusesWhatIsNoObject) {
  for (const std::string json : {"", "[]", "7", "{", "{\"lidar_mode\":\"512x10\"", "\xff\xfe"})
    EXPECT_THAT(problem_of(json), HasSubstr("not a JSON object")) << json;
  EXPECT_THAT(problem_of(std::string((1u << 20) + 1, ' ')), HasSubstr("over 1 MiB"));
  EXPECT_THAT(problem_of(R"({"sensor_info": 3, "lidar_data_format": []})"),
              HasSubstr("lidar_mode is missing"));
}

TEST(OusterMetadata, MessagesOfFilesStartWithTheirName) {
  const test::TempDir dir;
  const auto bad = read_ouster_metadata(dir.write("os.json", "{}"));
  ASSERT_FALSE(bad.ok());
  EXPECT_THAT(bad.error().message,
              AllOf(HasSubstr("os.json: Ouster metadata: "), HasSubstr("lidar_mode is missing")));
  EXPECT_FALSE(read_ouster_metadata(dir / "none.json").ok());
  EXPECT_TRUE(read_ouster_metadata(dir.write("good.json", test::ouster_json({}))).ok());
}

}  // namespace
}  // namespace mr::sensor::ouster_metadata_test
