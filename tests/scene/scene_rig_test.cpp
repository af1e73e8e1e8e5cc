#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mr/scene/scene.h"
#include "scene/scene_file.h"

namespace mr {
namespace {

using test::scene_of;
using test::SceneFile;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST_F(SceneFile, ARigReplacesSensors) {
  const SceneResult result = load(R"(scene: s
rig: {type: synthetic, seed: 4294967295, room: [6, 5, 3], sensors: 3, depth_mode: wfov, color: [640, 360],
      noise: none, calib_error_mm: 0, detail: 0.25, frames: 300}
)");
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  EXPECT_THAT(shorten(result.notices), IsEmpty());
  ASSERT_TRUE(result.scene.rig);
  EXPECT_TRUE(result.scene.sensors.empty());
  EXPECT_EQ(result.scene.rig->seed, 4294967295u);
  EXPECT_EQ(result.scene.rig->depth_width, 1024);
  EXPECT_EQ(result.scene.rig->color_height, 360);
  EXPECT_FALSE(result.scene.rig->noise);
  EXPECT_EQ(result.scene.rig->frames, 300);
  ASSERT_EQ(result.scene.mergers.size(), 1u);
  EXPECT_THAT(result.scene.mergers[0].inputs, ElementsAre("cam-0", "cam-1", "cam-2"));
}

TEST_F(SceneFile, ARigsMistakesAndNotices) {
  EXPECT_THAT(problems("scene: s\nrig: {sensors: 401}\n"), ElementsAre(HasSubstr("2: sensors")));
  EXPECT_THAT(problems("scene: s\nrig: {depth_mode: huge}\n"),
              ElementsAre(HasSubstr("depth_mode")));
  EXPECT_THAT(problems("scene: s\nrig: {noise: pink}\n"), ElementsAre(HasSubstr("kinect, none")));
  EXPECT_THAT(problems(scene_of({"a"}, "rig: {}\n")), ElementsAre(HasSubstr("not both")));
  EXPECT_THAT(
      problems("scene: s\nrig: {sensors: 2}\nmergers:\n  - {id: r, inputs: [cam-0, cam-2]}\n"),
      ElementsAre(HasSubstr("2: sensor 'cam-1' reaches no root"), HasSubstr("4: ")));
  EXPECT_THAT(problems("scene: s\nrig: {kind: castle}\n"), ElementsAre(HasSubstr("kind must be")));
  EXPECT_THAT(problems("scene: s\nrig: {sensors: 0}\n"),
              ElementsAre(HasSubstr("2: a rig needs at least one of sensors and lidars")));
  EXPECT_THAT(problems("scene: s\nrig: {sensors: 0, lidars: 1}\n"), IsEmpty());
  EXPECT_THAT(problems("scene: s\nrig: {lidars: 1, lidar_beams: 4}\n"),
              ElementsAre(HasSubstr("lidar_beams must be")));
  EXPECT_THAT(problems("scene: s\nrig: {clock_offset_ms: -1}\n"), ElementsAre(HasSubstr("2: ")));
}

TEST_F(SceneFile, AnEventsMistakesAreOneLineEach) {
  const auto of = [&](const std::string& events) {
    return problems("scene: s\nrig: {frames: 100, events: " + events + "}\n");
  };
  EXPECT_THAT(of("[{kind: sit, at: 10, place: [1, -1]}]"), IsEmpty());
  EXPECT_THAT(of("{kind: sit}"), ElementsAre(HasSubstr("events must be a list")));
  EXPECT_THAT(of("[{kind: jump, at: 10, x: 1}]"), ElementsAre(HasSubstr("kind must be one of")));
  EXPECT_THAT(of("[{at: 10}]"), ElementsAre(HasSubstr("lacks the key 'kind'")));
  EXPECT_THAT(of("[{kind: door}]"), ElementsAre(HasSubstr("lacks the key 'at'")));
  EXPECT_THAT(of("[{kind: door, at: 100}]"), ElementsAre(HasSubstr("after the rig's last, 99")));
  EXPECT_THAT(of("[{kind: door, at: 1, stops: 1}]"), ElementsAre(HasSubstr("unknown key 'stops'")));
  EXPECT_THAT(of("[{kind: push, at: 1}]"), ElementsAre(HasSubstr("lacks the key 'sensor'")));
  EXPECT_THAT(of("[{kind: dropout, at: 1, sensor: cam-9}]"),
              ElementsAre(HasSubstr("'cam-9', which is no sensor of the rig")));
  EXPECT_THAT(of("[{kind: chair, at: 1, place: [4, 0]}]"),
              ElementsAre(HasSubstr("outside the rig's room")));
  EXPECT_THAT(of("[{kind: light, at: 1, level: 2}]"), ElementsAre(HasSubstr("level must be")));
}

TEST_F(SceneFile, ARigHasPeopleErrorsAndOtherSensors) {
  const SceneResult result = load(R"(scene: s
rig: {kind: corridor, room: [2, 12, 2.6], people: 2, sensors: 400, lidars: 2, calib_error_mm: 5, calib_error_deg: 0.5,
      exposure_spread: 0.3, clock_offset_ms: 4, loop: true}
)");
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  EXPECT_THAT(shorten(result.notices), IsEmpty());
  const RigConfig& rig = *result.scene.rig;
  EXPECT_EQ(rig.kind, RigConfig::Kind::corridor);
  EXPECT_EQ(rig.people, 2);
  EXPECT_EQ(rig.calib_error_mm, 5);
  EXPECT_EQ(rig.calib_error_deg, 0.5);
  EXPECT_EQ(rig.exposure_spread, 0.3);
  EXPECT_EQ(rig.clock_offset_ms, 4);
  EXPECT_TRUE(rig.loop);
  ASSERT_EQ(result.scene.mergers[0].inputs.size(), 402u);
  EXPECT_EQ(result.scene.mergers[0].inputs[399], "cam-399");
  EXPECT_EQ(result.scene.mergers[0].inputs[401], "lidar-1");
}

TEST_F(SceneFile, TruthNamesTheSurfaceAndTheRigThatMadeIt) {
  const SceneResult result =
      load(scene_of({"a"}, "truth: {mesh: \"truth/%06d.ply\", rig: {seed: 7, kind: office}}\n"));
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  EXPECT_EQ(result.scene.truth->mesh, "truth/%06d.ply");
  EXPECT_EQ(result.scene.truth->rig->seed, 7u);
  EXPECT_THAT(problems(scene_of({"a"}, "truth: {rig: {seed: -1}}\n")),
              ElementsAre(HasSubstr("lacks the key 'mesh'"), HasSubstr("seed")));
}

}  // namespace
}  // namespace mr
