#include "mr/eval/scene_check.h"
#include "mr/sensor/rgbd_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "eval/small_scene.h"
#include "support/pictures.h"

namespace mr::eval {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

SceneCheck check_of(const SmallScene& small) {
  return check_scene(small.scene, small.config().rig_cache);
}

TEST(SceneCheck, SensorsThatAreCalibratedFit) {
  const SmallScene small;
  const SceneCheck check = check_of(small);
  ASSERT_THAT(check.sensors, SizeIs(3));
  for (const SensorCheck& sensor : check.sensors) {
    EXPECT_EQ(sensor.problem, "");
    EXPECT_EQ(sensor.depth_width, 320);
    EXPECT_EQ(sensor.color_height, 180);
    EXPECT_GT(sensor.valid_ratio, 0.5);
    EXPECT_LE(sensor.valid_ratio, 1);
    EXPECT_TRUE(0.2 < sensor.min_m && sensor.min_m < sensor.median_m &&
                sensor.median_m < sensor.max_m && sensor.max_m < 6);
    EXPECT_THAT(sensor.hints, IsEmpty());
  }
  ASSERT_FALSE(check.pairs.empty());
  for (const PairFit& pair : check.pairs) {
    EXPECT_EQ(pair.fit, Fit::good) << pair.a << " " << pair.b << " " << pair.residual_mm;
    EXPECT_GE(pair.noise_mm, 15);  // half a voxel
  }
  EXPECT_EQ(check.fit(), Fit::good);
  EXPECT_THAT(check.misfits, IsEmpty());
}

TEST(SceneCheck, ASensorThatStandsElsewhereDoesNotFit) {
  SmallScene small;
  Pose& pose = small.scene.sensors[1].T_world_depth[0];
  pose.translation = pose.translation + Vec3d{0.06, -0.06, 0.05};
  const SceneCheck check = check_of(small);
  EXPECT_EQ(check.fit(), Fit::bad);
  EXPECT_THAT(check.misfits, ElementsAre("cam-1"));
  ASSERT_FALSE(check.pairs.empty());
  EXPECT_TRUE(check.pairs.front().a == "cam-1" || check.pairs.front().b == "cam-1");
}

TEST(SceneCheck, ASensorFarAwayIsTold) {
  SmallScene small;
  small.scene.sensors[2].T_world_depth[0].translation.x += 50;
  const SceneCheck check = check_of(small);
  EXPECT_THAT(check.sensors[2].hints,
              ElementsAre(AllOf(HasSubstr("no surface"), HasSubstr("T_world_depth"))));
  EXPECT_THAT(check.sensors[0].hints, IsEmpty());
  EXPECT_EQ(check.fit(), Fit::good);
}

/// A camera before a wall, 2 m away, as pictures.
struct WallPicture {
  test::TempDir folder;
  Scene scene;

  explicit WallPicture(std::uint16_t count = 2000) {
    scene.id = "wall";
    SensorConfig sensor;
    sensor.id = "a";
    sensor.depth_camera.width = 64, sensor.depth_camera.height = 48;
    sensor.depth_camera.fx = sensor.depth_camera.fy = 50;
    sensor.depth_camera.cx = 31.5, sensor.depth_camera.cy = 23.5;
    sensor.T_world_depth = {Pose{}};
    Image<std::uint16_t, 1> counts(64, 48, count);
    for (int x = 0; x < 16; ++x)  // a quarter has none
      for (int y = 0; y < 48; ++y) *counts.at(x, y) = 0;
    sensor::RgbdImagesSource images;
    images.depth = {folder.write("d.png", test::depth_png(counts))};
    sensor.source = images;
    scene.sensors = {sensor};
  }
  sensor::RgbdImagesSource& source() {
    return *scene.sensors[0].source.get_if<sensor::RgbdImagesSource>();
  }
  SensorCheck check() const { return check_scene(scene, {}).sensors.at(0); }
};

TEST(SceneCheck, TellsSizesAndRange) {
  const SensorCheck check = WallPicture().check();
  EXPECT_EQ(check.depth_width, 64);
  EXPECT_EQ(check.depth_height, 48);
  EXPECT_EQ(check.color_width, 0);
  EXPECT_DOUBLE_EQ(check.valid_ratio, 0.75);
  EXPECT_EQ(check.outside_ratio, 0);
  EXPECT_NEAR(check.min_m, 2, 1e-6);
  EXPECT_NEAR(check.median_m, 2, 1e-6);
  EXPECT_NEAR(check.max_m, 2, 1e-6);
  EXPECT_THAT(check.hints, IsEmpty());
}

TEST(SceneCheck, AWrongUnitIsTold) {
  WallPicture wall;
  wall.source().depth_unit_m = 0.00001;
  const SensorCheck check = wall.check();
  EXPECT_EQ(check.valid_ratio, 0);
  EXPECT_EQ(check.outside_ratio, 1);
  EXPECT_NEAR(check.median_m, 0.02, 1e-6);
  EXPECT_THAT(check.hints, ElementsAre(AllOf(HasSubstr("depth_unit_m"), HasSubstr("2 m")),
                                       HasSubstr("depth_range_m [0.3, 5]")));
}

TEST(SceneCheck, DepthOutOfRangeIsTold) {
  WallPicture wall;
  wall.scene.sensors[0].depth_far_m = 1.5;
  EXPECT_THAT(wall.check().hints, ElementsAre(HasSubstr("100 % of the pixels with depth")));
}

TEST(SceneCheck, APictureWithoutDepthIsTold) {
  EXPECT_THAT(WallPicture(0).check().hints, ElementsAre(HasSubstr("no pixel has depth")));
}

TEST(SceneCheck, APictureThatCannotBeReadIsTold) {
  WallPicture wall;
  wall.source().depth = {wall.folder.write("cut.png", "no picture")};
  EXPECT_THAT(wall.check().problem, HasSubstr("cut.png"));
}

// Missing files were reported when the scene was loaded.
TEST(SceneCheck, TheFirstPictureThatIsThereIsLookedAt) {
  WallPicture wall;
  const auto there = wall.source().depth.front();
  wall.source().depth = {wall.folder / "none.png", there, there};
  wall.scene.sensors[0].T_world_depth.assign(3, Pose{});
  wall.scene.sensors[0].lost_poses[1] = {Error::Cause::invalid, "no numbers"};
  const SensorCheck check = wall.check();
  EXPECT_EQ(check.problem, "");
  EXPECT_EQ(check.depth_width, 64);
  wall.source().depth.assign(3, wall.folder / "none.png");
  EXPECT_THAT(wall.check().problem, HasSubstr("none.png"));
}

}  // namespace
}  // namespace mr::eval
