#include "mr/eval/scene_clocks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/temp_dir.h"
#include "mr/node/sources.h"
#include "mr/sensor/rgbd_images.h"
#include "support/pictures.h"

namespace mr::eval {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

struct RigScene {
  test::TempDir folder;
  Scene scene;

  explicit RigScene(const std::string& rig) {
    const auto file = folder.write(
        "rig.yaml",
        "scene: rig\nup: [0, 0, 1]\n"
        "rig: {type: synthetic, seed: 2, room: [4, 3.5, 2.6], depth_mode: nfov_binned, "
        "color: [32, 24], " +
            rig + "}\n");
    SceneResult loaded = load_scene(file);
    for (const SceneProblem& problem : loaded.problems) ADD_FAILURE() << to_string(problem);
    scene = *node::prepare_scene(loaded.scene);
    scene.sensors.resize(2);  // of four, side by side
  }
  SceneClocks clocks() const { return compare_clocks(scene, {}); }
};

TEST(SceneClocks, OffsetsOfARigAreWithin3Ms) {
  const RigScene rig("sensors: 4, people: 2, frames: 30, clock_offset_ms: 25");
  const SceneClocks clocks = rig.clocks();
  EXPECT_EQ(clocks.reference, "cam-0");
  EXPECT_EQ(clocks.frames, 30u);
  EXPECT_NEAR(clocks.seconds, 29 / 30.0, 1e-6);
  ASSERT_THAT(clocks.clocks, SizeIs(2));
  for (const SensorClock& clock : clocks.clocks) {
    ASSERT_TRUE(clock.offset_ms) << clock.id << ": " << clock.problem;
    ASSERT_TRUE(clock.true_ms);
    EXPECT_NEAR(*clock.offset_ms, *clock.true_ms, 3) << clock.id;
    EXPECT_EQ(clock.clock_offset_ms, *clock.offset_ms);
  }
  EXPECT_GT(std::abs(*clocks.clocks[1].true_ms), 4) << "else nothing is shown";
}

TEST(SceneClocks, AreComparedFromAnyPlaceOn) {
  const RigScene rig("sensors: 4, people: 2, frames: 60, clock_offset_ms: 25");
  const SceneClocks later = compare_clocks(rig.scene, {}, {.from_s = 1});
  EXPECT_EQ(later.frames, 30u);
  EXPECT_NEAR(later.seconds, 29 / 30.0, 1e-6);
  ASSERT_THAT(later.clocks, SizeIs(2));
  ASSERT_TRUE(later.clocks[1].offset_ms) << later.clocks[1].problem;
  EXPECT_NEAR(*later.clocks[1].offset_ms, *later.clocks[1].true_ms, 3);
  const SceneClocks behind = compare_clocks(rig.scene, {}, {.from_s = 2});
  EXPECT_EQ(behind.frames, 0u);
  EXPECT_THAT(behind.clocks[0].problem, HasSubstr("no pictures"));
}

TEST(SceneClocks, AnEmptyRoomGivesNone) {
  const SceneClocks clocks = RigScene("sensors: 4, frames: 10").clocks();
  EXPECT_EQ(clocks.reference, "");
  EXPECT_EQ(clocks.problem, "nothing moves");
  for (const SensorClock& clock : clocks.clocks) {
    EXPECT_EQ(clock.offset_ms, std::nullopt);
    EXPECT_EQ(clock.true_ms, std::nullopt);
  }
}

TEST(SceneClocks, SensorsThatCannotBeComparedSayWhy) {
  test::TempDir folder;
  Scene scene;
  scene.id = "files";
  SensorConfig moving;
  moving.id = "moving";
  moving.depth_camera.width = 8, moving.depth_camera.height = 6;
  moving.depth_camera.fx = moving.depth_camera.fy = 8;
  moving.T_world_depth = {Pose{}, Pose{}};
  sensor::RgbdImagesSource images;
  images.depth = {folder.write("cut.png", "no picture"), folder.write("too.png", "no picture")};
  moving.source = images;
  SensorConfig unread = moving;
  unread.id = "unread";
  unread.T_world_depth = {Pose{}};
  scene.sensors = {moving, unread};
  const SceneClocks clocks = compare_clocks(scene, {});
  ASSERT_THAT(clocks.clocks, SizeIs(2));
  EXPECT_EQ(clocks.clocks[0].problem, "it moves itself");
  EXPECT_THAT(clocks.clocks[1].problem, HasSubstr("too.png"));
  EXPECT_EQ(clocks.frames, 0u);
}

}  // namespace
}  // namespace mr::eval
