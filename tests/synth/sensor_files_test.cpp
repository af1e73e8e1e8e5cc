#include "mr/synth/sensor_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include "core/temp_dir.h"
#include "mr/kit/image_io.h"
#include "mr/synth/export_rig.h"
#include "mr/synth/room.h"
#include "support/pictures.h"

namespace mr::synth {
namespace {

using test::TempDir;
using testing::AllOf;
using testing::HasSubstr;

std::vector<std::string> lines_of_list(const std::filesystem::path& file) {
  std::vector<std::string> out;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

Frame tum_frame(int i) {
  Frame frame;
  frame.exposure_start = frame.exposure_end =
      TimePoint(Duration(std::int64_t{i} * 1'000'000'000 / 30));
  frame.depth = ImageDepth(64, 48, 1.234f + 0.001f * static_cast<float>(i));
  frame.depth.data[0] = 0, frame.depth.data[1] = 20;
  frame.color = test::gradient(32, 24);
  frame.color.data[0] = static_cast<std::uint8_t>(i);
  return frame;
}

/// The transform of a line of groundtruth.txt.
Pose pose_of_line(const std::string& line) {
  std::istringstream in(line);
  double time = 0, x = 0, y = 0, z = 0, w = 0;
  Pose T;
  in >> time >> T.translation.x >> T.translation.y >> T.translation.z >> x >> y >> z >> w;
  EXPECT_NEAR(x * x + y * y + z * z + w * w, 1, 1e-8);
  T.rotation.m = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
                  2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                  2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
  return T;
}

std::unique_ptr<SensorFiles> opened(const TempDir& dir, const Pose& T_world_depth) {
  auto files = open_tum_folder(dir / "cam-0", T_world_depth, 30);
  EXPECT_TRUE(files) << files.error().message;
  return std::move(*files);
}

TEST(TumFolder, ListsPicturesOfUnevenTimes) {
  const TempDir dir;
  const auto files = opened(dir, {});
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(files->write(tum_frame(i)));
  ASSERT_TRUE(files->close());
  const auto color = lines_of_list(dir / "cam-0/rgb.txt"),
             depth = lines_of_list(dir / "cam-0/depth.txt"),
             poses = lines_of_list(dir / "cam-0/groundtruth.txt");
  EXPECT_EQ(color.at(1), "# file: 'cam-0'");
  EXPECT_EQ(depth.at(2), "# timestamp filename");
  ASSERT_EQ(depth.size(), 3u + 5);
  ASSERT_EQ(color.size(), 3u + 6);
  ASSERT_EQ(poses.size(), 3u + 6);
  EXPECT_EQ(depth[3], "1305031102.160407 depth/1305031102.160407.png");
  EXPECT_EQ(depth[4], "1305031102.193740 depth/1305031102.193740.png");
  std::set<long> distances_us;
  for (std::size_t n = 3; n < 8; ++n) {
    const double apart = std::stod(color[n]) - std::stod(depth[n]);
    EXPECT_TRUE(apart > 0.0038 && apart < 0.006) << apart;
    distances_us.insert(std::lround(apart * 1e6));
    EXPECT_EQ(poses[n].substr(0, 17), depth[n].substr(0, 17));
  }
  EXPECT_GT(distances_us.size(), 1u);
  EXPECT_NEAR(std::stod(color[8]) - std::stod(color[7]), 1.0 / 30, 0.002);
  for (std::size_t n = 3; n < 9; ++n) {
    const auto picture = kit::read_color(dir / "cam-0" / color[n].substr(18));
    ASSERT_TRUE(picture);
    EXPECT_EQ(picture->data[0], std::min<std::size_t>(n - 3, 4));  // the last one twice
  }
}

TEST(TumFolder, DepthIsInFifthsOfAMillimetre) {
  const TempDir dir;
  const auto files = opened(dir, {});
  ASSERT_TRUE(files->write(tum_frame(0)));
  const auto counts = kit::read_depth16(dir / "cam-0/depth/1305031102.160407.png");
  ASSERT_TRUE(counts);
  EXPECT_EQ(counts->data[0], 0);
  EXPECT_EQ(counts->data[1], 65535);  // 20 m are more than 16 bits hold
  EXPECT_EQ(counts->data[2], 6170);
}

TEST(TumFolder, PosesAreQuaternions) {
  const Vec3d eyes[] = {{3, 0.1, 0.2}, {-3, 0.3, 0.5}, {0.1, 3, -1},
                        {0.2, -3, 1},  {0.1, 0.2, 4},  {0.3, 0.1, -4}};
  for (const Vec3d eye : eyes)
    for (const Vec3d up : {Vec3d{0, 0, 1}, Vec3d{0, 0, -1}, Vec3d{1, 0, 0.1}, Vec3d{0, -1, 0.1}}) {
      const TempDir dir;
      const Pose T = look_at(eye, {}, up);
      const auto files = opened(dir, T);
      ASSERT_TRUE(files->write(tum_frame(0)));
      ASSERT_TRUE(files->close());
      const Pose read = pose_of_line(lines_of_list(dir / "cam-0/groundtruth.txt").at(3));
      EXPECT_LT(length(read.translation - T.translation), 2e-9);
      for (int k = 0; k < 9; ++k) EXPECT_NEAR(read.rotation.m[k], T.rotation.m[k], 1e-8);
    }
}

TEST(TumFolder, FailuresNameTheFolder) {
  const TempDir dir;
  dir.write("cam-0", "a file");
  EXPECT_THAT(open_tum_folder(dir / "cam-0", {}, 30).error().message,
              AllOf(HasSubstr("cannot make folder"), HasSubstr("cam-0")));
}

TEST(TumFolder, OfARigIsASceneWithATrajectory) {
  const TempDir dir;
  RigConfig rig;
  rig.sensors = 1, rig.frames = 1, rig.depth_width = 320, rig.depth_height = 288;
  rig.color_width = 320, rig.color_height = 180, rig.calib_error_mm = 20;
  RigExport what{rig, 30, dir.path()};
  what.format = RigExport::Format::tum;
  ASSERT_TRUE(export_rig(what));
  std::ostringstream scene;
  scene << std::ifstream(dir / "scene.yaml").rdbuf();
  EXPECT_THAT(scene.str(),
              AllOf(HasSubstr("source: {type: tum, folder: cam-0, depth_unit_m: 0.0002}\n"
                              "    depth_camera: {model: pinhole"),
                    HasSubstr("T_world_depth: {trajectory: cam-0/groundtruth.txt}")));
  const Pose stated = rig_sensors(rig)[0].T_world_depth[0];
  const Pose read = pose_of_line(lines_of_list(dir / "cam-0/groundtruth.txt").at(3));
  EXPECT_LT(length(read.translation - stated.translation), 2e-9);
  EXPECT_FALSE(std::filesystem::exists(dir / "cam-0/color"));
}

}  // namespace
}  // namespace mr::synth
