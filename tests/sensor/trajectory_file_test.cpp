#include "mr/sensor/folders/trajectory_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "core/temp_dir.h"
#include "mr/sensor/folders/text_lines.h"
#include "support/shared_data.h"

namespace mr::sensor {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Layout = TrajectoryFile::Layout;

std::string error_of(const std::string& text) {
  const auto file = parse_trajectory(text, "poses.txt");
  return file ? "" : file.error().message;
}

std::vector<double> heights(const TrajectoryFile& file) {
  std::vector<double> out;
  for (const Pose& pose : file.by_item) out.push_back(pose.translation.z);
  return out;
}

std::string line16(double z) { return "1 0 0 0 0 1 0 0 0 0 1 " + std::to_string(z) + " 0 0 0 1\n"; }

std::string lines4(double z) {
  return "1 0 0 0\n0 1 0 0\n0 0 1 " + std::to_string(z) + "\n0 0 0 1\n";
}

TEST(TextLines, SecondsAreExactToTheNanosecond) {
  const auto ns = [](std::string_view word) {
    const auto time = time_of_seconds(word);
    return time ? time->time_since_epoch().count() : -999;
  };
  EXPECT_EQ(ns("1305031102.175304"), 1305031102175304000);
  EXPECT_EQ(ns("1305031102.175304123"), 1305031102175304123);
  EXPECT_EQ(ns("1305031102.1753041235"), 1305031102175304124) << "rounded";
  EXPECT_EQ(ns("1.305031102175304e+09"), 1305031102175304000);
  EXPECT_EQ(ns("1305031102"), 1305031102000000000);
  EXPECT_EQ(ns(".5"), 500000000);
  EXPECT_EQ(ns("5e-10"), 1);
  EXPECT_EQ(ns("-0.25"), -250000000);
  EXPECT_EQ(ns("0"), 0);
  EXPECT_EQ(ns("1e-90"), 0);
  for (const char* word :
       {"", ".", "x", "1.2.3", "1e", "1e999", "inf", "nan", "1 ", "9000000001", "1e50", "--1"})
    EXPECT_EQ(ns(word), -999) << word;
}

TEST(TrajectoryFile, TumHasTimesAndQuaternions) {
  const auto file = parse_trajectory(
      "# ground truth trajectory\r\n"
      "# timestamp tx ty tz qx qy qz qw\r\n"
      "1305031098.6659 1.5 -2 0.25 0 0 0 1\r\n"
      "1305031098.6758 0 0 0 0 0 0.70710678 0.70710678\r\n",
      "poses.txt");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->layout, Layout::tum);
  EXPECT_TRUE(file->by_item.empty());
  ASSERT_EQ(file->timed.poses().size(), 2u);
  const TimedPose &first = file->timed.poses()[0], &second = file->timed.poses()[1];
  EXPECT_EQ(first.at.time_since_epoch().count(), 1305031098665900000);
  EXPECT_EQ(first.T_world_sensor, (Pose{Mat3{}, {1.5, -2, 0.25}}));
  // A quarter turn about z: x becomes y.
  const Vec3d turned = second.T_world_sensor * Vec3d{1, 0, 0};
  EXPECT_NEAR(turned.x, 0, 1e-7);
  EXPECT_NEAR(turned.y, 1, 1e-7);
}

TEST(TrajectoryFile, QuaternionsAreNormalizedAndOthersRefused) {
  const auto file = parse_trajectory("0 0 0 0 0 0 0 1.004\n", "poses.txt");
  ASSERT_TRUE(file);
  EXPECT_EQ(file->timed.poses()[0].T_world_sensor, Pose{});
  EXPECT_THAT(error_of("0 0 0 0 0 0 0 1\n1 0 0 0 0.5 0 0 1\n"),
              AllOf(HasSubstr("poses.txt: line 2"), HasSubstr("quaternion of length 1.118")));
  EXPECT_THAT(error_of("0 0 0 0 0 0 0 0\n"), HasSubstr("length 0.0"));
}

TEST(TrajectoryFile, ReadsEveryLayoutOfMatrices) {
  const std::string redwood = "0 0 1\n" + lines4(1) + "# between\n7 -3 9\n" + lines4(2);
  const std::string livescan =
      "0\t000123512\t0\n1\t0\t0\t0\t0\t1\t0\t0\t0\t0\t1\t1\t0\t0\t0\t1\n0\t000123513\t1\n" +
      line16(2);
  const std::string kitti = "1 0 0 0 0 1 0 0 0 0 1 1\n1 0 0 0 0 1 0 0 0 0 1 2\n";
  const std::pair<std::string, Layout> layouts[] = {{redwood, Layout::log},
                                                    {livescan, Layout::log},
                                                    {kitti, Layout::matrix34},
                                                    {line16(1) + line16(2), Layout::matrix},
                                                    {lines4(1) + "\n" + lines4(2), Layout::matrix}};
  for (const auto& [text, layout] : layouts) {
    const auto file = parse_trajectory(text, "poses.txt");
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_EQ(file->layout, layout) << text;
    EXPECT_THAT(heights(*file), ElementsAre(1, 2)) << text;
    EXPECT_THAT(file->lost, IsEmpty());
    EXPECT_THAT(file->timed.poses(), IsEmpty());
  }
}

TEST(TrajectoryFile, LostPosesCostTheirItemsOnly) {
  const std::string lost = "-inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf -inf 0 0 0 1\n";
  const std::string mirrored = "-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n";
  const auto file = parse_trajectory(
      lost + line16(1) + mirrored + line16(3) + "nan" + line16(4).substr(1), "poses.txt");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_THAT(heights(*file), ElementsAre(1, 1, 1, 3, 3));
  ASSERT_EQ(file->lost.size(), 3u);
  EXPECT_THAT(file->lost.at(0).message, AllOf(HasSubstr("line 1"), HasSubstr("not finite")));
  EXPECT_THAT(file->lost.at(2).message, AllOf(HasSubstr("line 3"), HasSubstr("mirrored")));
  EXPECT_TRUE(file->lost.contains(4));
  EXPECT_THAT(error_of(lost + mirrored),
              AllOf(HasSubstr("none of the 2 poses"), HasSubstr("line 1")));

  const auto timed = parse_trajectory("0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", "p");
  ASSERT_TRUE(timed);
  EXPECT_EQ(timed->timed.poses().size(), 2u);
  EXPECT_TRUE(timed->lost.contains(1));
}

TEST(TrajectoryFile, ErrorsNameTheLine) {
  EXPECT_THAT(error_of(""), HasSubstr("holds no poses"));
  EXPECT_THAT(error_of("# nothing\n\n"), HasSubstr("holds no poses"));
  EXPECT_THAT(error_of("\n1 2 3 4 5\n"), AllOf(HasSubstr("line 2"), HasSubstr("5 words")));
  EXPECT_THAT(error_of(line16(1) + "1 0 0 0\n"), AllOf(HasSubstr("line 2"), HasSubstr("not 16")));
  EXPECT_THAT(error_of(line16(1) + "1 0 0 zero 0 1 0 0 0 0 1 0 0 0 0 1\n"),
              AllOf(HasSubstr("line 2"), HasSubstr("'zero'")));
  EXPECT_THAT(error_of("0 0 1\n"), HasSubstr("a matrix is wanted"));
  EXPECT_THAT(error_of("0 0 1\n1 0 0 0\n0 1 0 0\n"), HasSubstr("within a matrix"));
  EXPECT_THAT(error_of("0 0 1\n1 0 0 0\n0 1 0\n"), AllOf(HasSubstr("line 3"), HasSubstr("not 4")));
  EXPECT_THAT(error_of("now 0 0 0 0 0 0 1\n"), HasSubstr("a time in seconds"));
  const test::TempDir dir;
  const auto none = read_trajectory_file(dir / "none.txt");
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().message, HasSubstr("none.txt"));
}

TEST(TrajectoryFile, ReadsTheDrivenScansOfOuster) {
  const auto path = test::shared_data() / "ouster/OS-1-128_v2.3.0_1024x10_lb_n3_poses_kitti.txt";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path << " (set MR_DATA)";
  const auto file = read_trajectory_file(path);
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_EQ(file->by_item.size(), 3u);
  EXPECT_NEAR(file->by_item[1].translation.x, 0.2454, 1e-4);
}

}  // namespace
}  // namespace mr::sensor
