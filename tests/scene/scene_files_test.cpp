#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>

#include "mr/sensor/rgbd_images.h"
#include "scene/scene_file.h"

namespace mr {
namespace {

using test::kIdentity;
using test::long_sensor;
using test::SceneFile;
using test::sensor;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST_F(SceneFile, PatternsNameTheirFiles) {
  for (const char* name : {"p/0008.png", "p/0009.png", "p/0010.png", "q/9.png", "q/10.png"})
    dir_.write(name, "x");
  const SceneResult padded =
      load(long_sensor("{type: rgbd-images, depth: {pattern: p/%04d.png, first: 8, last: 10}}"));
  EXPECT_THAT(shorten(padded.problems), IsEmpty());
  const auto& files = padded.scene.sensors.at(0).source.get_if<sensor::RgbdImagesSource>()->depth;
  EXPECT_THAT(files, ElementsAre(dir_ / "p/0008.png", dir_ / "p/0009.png", dir_ / "p/0010.png"));
  EXPECT_THAT(
      problems(long_sensor("{type: rgbd-images, depth: {pattern: q/%d.png, first: 9, last: 10}}")),
      IsEmpty());

  std::filesystem::create_directories(dir_ / "empty");
  EXPECT_THAT(problems(long_sensor(
                  "{type: rgbd-images, depth: {pattern: empty/%d.png, first: 0, last: 9}}")),
              ElementsAre(testing::AllOf(HasSubstr("none of the 10"), HasSubstr("is empty"))));
  EXPECT_THAT(problems(long_sensor("{type: rgbd-images, depth: []}")),
              ElementsAre(HasSubstr("4: depth must name at least one file")));
  EXPECT_THAT(problems(long_sensor("{type: rgbd-images, depth: empty}")),
              ElementsAre(HasSubstr("is a folder")));
  EXPECT_THAT(problems(long_sensor("{type: rgbd-images, depth: {pattern: p/%04d.png, first: 8}}")),
              ElementsAre(HasSubstr("lacks the key 'last'")));
}

TEST_F(SceneFile, FilesThatAreMissingCostTheirFramesOnly) {
  for (const char* name : {"p/1.png", "p/2.png", "p/4.png", "a.jpg"}) dir_.write(name, "x");
  const std::string color = "    color_camera: {size: [9, 9], fx: 9, fy: 9, cx: 4, cy: 4}\n";
  const SceneResult some = load(long_sensor(
      "{type: rgbd-images, depth: {pattern: p/%d.png, first: 0, last: 4}, color: [a.jpg, a.jpg, "
      "b.jpg, a.jpg, a.jpg]}",
      kIdentity, color));
  EXPECT_THAT(shorten(some.problems), IsEmpty());
  EXPECT_THAT(
      shorten(some.notices),
      ElementsAre(testing::AllOf(HasSubstr("4: sensors.a.source.depth: 2 of the 5 files of the "
                                           "pattern are missing, their frames are lost; first: "),
                                 HasSubstr("p/0.png'")),
                  testing::AllOf(HasSubstr("4: sensors.a.source.color: 1 of the 5 files of the "
                                           "list is missing, its frame is lost: "),
                                 HasSubstr("b.jpg'"))));
  // They keep their places, so that the others keep theirs.
  const auto& files = some.scene.sensors.at(0).source.get_if<sensor::RgbdImagesSource>()->depth;
  ASSERT_EQ(files.size(), 5u);
  EXPECT_EQ(files[4], dir_ / "p/4.png");
  EXPECT_THAT(notices(long_sensor("{type: rgbd-images, depth: [p, p/1.png]}")),
              ElementsAre(testing::AllOf(HasSubstr("1 of the 2 files of the list cannot be used"),
                                         HasSubstr("p' is a folder"))));
}

TEST_F(SceneFile, HostilePatternsAreRefused) {
  for (const char* pattern :
       {"%s", "%n", "%", "%%", "x", "%d%d", "%0d", "%012d", "%*d", "%-4d", "%ld"})
    EXPECT_THAT(problems(long_sensor(std::string("{type: rgbd-images, depth: {pattern: \"") +
                                     pattern + "\", first: 0, last: 1}}")),
                ElementsAre(HasSubstr("pattern must hold one %d")))
        << pattern;
  EXPECT_THAT(problems(long_sensor(
                  "{type: rgbd-images, depth: {pattern: \"%d\", first: 0, last: 999999999}}")),
              ElementsAre(HasSubstr("too many files")));
  EXPECT_THAT(
      problems(long_sensor("{type: rgbd-images, depth: {pattern: \"%d\", first: 2, last: 1}}")),
      ElementsAre(HasSubstr("last must not be less")));
}

TEST_F(SceneFile, PosesComeInlineFromAFileOrOnePerItem) {
  dir_.write("e.png", "x");
  for (int i = 0; i < 3; ++i)
    dir_.write("pose/" + std::to_string(i) + ".txt",
               "1\t0 0 " + std::to_string(i) + "\r\n0 1 0 0 \n0 0 1 0\n0 0 0 1e0\n\n");
  dir_.write("pose/short.txt", "1 0 0");
  dir_.write("pose/words.txt", "one two");
  dir_.write("pose/mirrored.txt", "-1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1");
  const std::string two = "{type: rgbd-images, depth: [d.png, e.png]}";

  const SceneResult moving = load(long_sensor(two, "{pattern: pose/%d.txt, first: 1, last: 2}"));
  EXPECT_THAT(shorten(moving.problems), IsEmpty());
  ASSERT_EQ(moving.scene.sensors[0].T_world_depth.size(), 2u);
  EXPECT_EQ(moving.scene.sensors[0].T_world_depth[1].translation, (Vec3d{2, 0, 0}));

  EXPECT_THAT(problems(long_sensor(two, "{files: [pose/0.txt, pose/1.txt]}")), IsEmpty());
  EXPECT_THAT(problems(long_sensor(two, "{file: pose/0.txt}")), IsEmpty());
  EXPECT_THAT(problems(long_sensor(two, "{pattern: pose/%d.txt, first: 0, last: 2}")),
              ElementsAre(HasSubstr("6: T_world_depth holds 3 poses for 2 items")));
  EXPECT_THAT(problems(long_sensor(two, "{file: pose/short.txt}")),
              ElementsAre(HasSubstr("holds 3 numbers, not 16")));
  EXPECT_THAT(problems(long_sensor(two, "{file: pose/words.txt}")),
              ElementsAre(HasSubstr("'one'")));
  EXPECT_THAT(problems(long_sensor(two, "{file: pose/mirrored.txt}")),
              ElementsAre(testing::AllOf(HasSubstr("6: "), HasSubstr("mirrored"))));
  EXPECT_THAT(problems(long_sensor(two, "{file: pose/none.txt}")),
              ElementsAre(testing::AllOf(HasSubstr("no such file"), HasSubstr("pose/none.txt"))));
  EXPECT_THAT(problems(long_sensor(two, "[1, 0, 0]")),
              ElementsAre(HasSubstr("list of 16 numbers")));
  EXPECT_THAT(problems(long_sensor(two, "[2, 0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]")),
              ElementsAre(HasSubstr("not rigid")));
  EXPECT_THAT(problems(long_sensor(two, "{}")),
              ElementsAre(HasSubstr("one of file, files, pattern")));
}

TEST_F(SceneFile, PosesThatCannotBeUsedCostTheirFramesOnly) {
  dir_.write("e.png", "x");
  for (const int i : {1, 2, 4})
    dir_.write("pose/" + std::to_string(i) + ".txt",
               "1 0 0 " + std::to_string(i) + " 0 1 0 0 0 0 1 0 0 0 0 1");
  dir_.write("pose/5.txt", "one two");
  const auto images = [](int n) {
    std::string list = "{type: rgbd-images, depth: [d.png";
    for (int i = 1; i < n; ++i) list += ", e.png";
    return list + "]}";
  };
  const SceneResult some =
      load(long_sensor(images(6), "{pattern: pose/%d.txt, first: 0, last: 5}"));
  EXPECT_THAT(shorten(some.problems), IsEmpty());
  EXPECT_THAT(shorten(some.notices),
              ElementsAre(testing::AllOf(
                  HasSubstr("6: sensors.a.T_world_depth: 3 of the 6 files of the pattern cannot be "
                            "used, their frames are lost; first: no such file: "),
                  HasSubstr("pose/0.txt'"))));
  const SensorConfig& sensor = some.scene.sensors.at(0);
  std::vector<double> x;
  for (const Pose& pose : sensor.T_world_depth) x.push_back(pose.translation.x);
  EXPECT_THAT(x, ElementsAre(1, 1, 2, 2, 4, 4));
  ASSERT_EQ(sensor.lost_poses.size(), 3u);
  EXPECT_THAT(sensor.lost_poses.at(3).message, HasSubstr("pose/3.txt"));
  EXPECT_THAT(sensor.lost_poses.at(5).message, HasSubstr("'one'"));

  EXPECT_THAT(notices(long_sensor(images(2), "{files: [pose/5.txt, pose/1.txt]}")),
              ElementsAre(testing::AllOf(HasSubstr("1 of the 2 files of the list cannot be used, "
                                                   "its frame is lost: pose file"),
                                         HasSubstr("'one'"))));
  // Without a single one nothing can run.
  EXPECT_THAT(problems(long_sensor(images(2), "{pattern: pose/%d.txt, first: 5, last: 6}")),
              ElementsAre(testing::AllOf(HasSubstr("6: T_world_depth: none of the 2 pose files can "
                                                   "be used; first: "),
                                         HasSubstr("'one'"))));
  EXPECT_THAT(problems(long_sensor(images(2), "{pattern: pose/%d.txt, first: 6, last: 7}")),
              ElementsAre(HasSubstr("T_world_depth: none of the 2 files of the pattern exists")));
}

TEST_F(SceneFile, WhatOneMissingFolderShouldHoldIsToldOnce) {
  ::unsetenv("MR_TEST_UNSET");
  const std::string room = "${MR_TEST_UNSET:-none}/room/";
  EXPECT_THAT(problems(long_sensor("{type: rgbd-images, depth: {pattern: \"" + room +
                                       "%d.png\", first: 0, last: 4}}",
                                   "{file: \"" + room + "pose.txt\"}")),
              ElementsAre(testing::AllOf(
                  HasSubstr("4: no folder '"), HasSubstr("/none', where 6 files of this scene"),
                  HasSubstr("; set MR_TEST_UNSET to the folder that holds 'room'"))));
  // Files missing in an existing folder are reported one by one.
  EXPECT_THAT(problems(long_sensor("{type: rgbd-images, depth: [x.png, y.png]}")),
              ElementsAre(HasSubstr("no such file"), HasSubstr("no such file")));
  // A single missing file is reported by its path.
  EXPECT_THAT(
      problems(long_sensor("{type: rgbd-images, depth: none/x.png}")),
      ElementsAre(testing::AllOf(HasSubstr("4: depth: no such file"), HasSubstr("none/x.png"))));
}

}  // namespace
}  // namespace mr
