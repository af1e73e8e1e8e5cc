#include "mr/scene/scene_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>

#include "mr/sensor/rgbd_images.h"
#include "scene/scene_file.h"
#include "support/pictures.h"

namespace mr {
namespace {

using sensor::ImportedScene;
using sensor::ImportedSensor;
using test::SceneFile;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

Camera pinhole() {
  Camera camera;
  camera.width = 640, camera.height = 480;
  camera.fx = 525.25, camera.fy = 1.0 / 3 + 525, camera.cx = 319.5, camera.cy = 239.5;
  return camera;
}

ImportedScene one_sensor(const std::filesystem::path& folder, const std::string& id) {
  ImportedSensor sensor;
  sensor.id = id;
  sensor.source = "{type: rgbd-images, depth: [\"" + (folder / "d.png").string() +
                  "\"], depth_unit_m: 0.0002, invalid: [0, 65535], loop: true}";
  sensor.depth_camera = pinhole();
  ImportedScene scene;
  scene.name = id;
  scene.sensors = {sensor};
  return scene;
}

TEST_F(SceneFile, WhatIsImportedIsLoadedAgain) {
  ImportedScene scene = one_sensor(dir_.path(), "cam");
  scene.up = Vec3d{0, -1, 0.25};
  scene.fps = 29.97;
  scene.notes = {"the scale is 0.0002"};
  ImportedSensor& sensor = scene.sensors[0];
  sensor.source.insert(sensor.source.size() - 1,
                       ", color: [\"" + (dir_ / "d.png").string() + "\"]");
  sensor.color_camera = pinhole();
  sensor.color_camera->distortion = DistortionModel::rational;
  sensor.color_camera->k = {0.5, -0.25, 0.1, 0.4, -0.2, 0.01};
  sensor.color_camera->p = {0.001, -0.002};
  sensor.color_camera->most_radius = 1.7;
  sensor.T_color_depth = Pose{{}, {-0.032, 0.1, 1.0 / 3}};
  sensor.T_world_depth = "[1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 2, 0, 0, 0, 1]";
  sensor.depth_near_m = 0.4, sensor.depth_far_m = 4;
  sensor.precision = Precision{.base_m = 0.002, .per_m2 = 0.003};
  sensor.comments = {"by a test"};

  const std::string text = scene_text(scene, dir_.path());
  EXPECT_THAT(text, AllOf(HasSubstr("# the scale is 0.0002\n"), HasSubstr("  # by a test\n"),
                          HasSubstr("depth: [\"d.png\"]")))
      << "paths are relative to the file";
  const SceneResult read = load(text);
  EXPECT_THAT(shorten(read.problems), IsEmpty());
  ASSERT_EQ(read.scene.sensors.size(), 1u);
  const SensorConfig& config = read.scene.sensors[0];
  EXPECT_EQ(config.depth_camera, *sensor.depth_camera) << "to the last bit";
  EXPECT_EQ(config.color_camera, sensor.color_camera);
  EXPECT_EQ(config.T_color_depth, *sensor.T_color_depth);
  EXPECT_EQ(config.T_world_depth.at(0).translation, (Vec3d{0.5, 0, 2}));
  EXPECT_EQ(config.depth_far_m, 4);
  EXPECT_EQ(config.precision.per_m2, 0.003);
  EXPECT_EQ(read.scene.fps, 29.97);
  const auto* images = config.source.get_if<sensor::RgbdImagesSource>();
  ASSERT_TRUE(images);
  EXPECT_EQ(images->depth.at(0), dir_ / "d.png");
  EXPECT_EQ(images->depth_unit_m, 0.0002);
  std::size_t longest = 0, at = 0;
  for (std::size_t end; (end = text.find('\n', at)) != std::string::npos; at = end + 1)
    longest = std::max(longest, end - at);
  EXPECT_LE(longest, 110u) << text;
}

TEST_F(SceneFile, PathsFarFromTheSceneFileStayAbsolute) {
  const ImportedScene scene = one_sensor("/data/set", "cam");
  EXPECT_THAT(scene_text(scene, "/data/set/out"), HasSubstr("\"../d.png\""));
  EXPECT_THAT(scene_text(scene, "/data/scenes"), HasSubstr("\"../set/d.png\""));
  EXPECT_THAT(scene_text(scene, "/home/me/scenes"), HasSubstr("\"/data/set/d.png\""));
}

TEST_F(SceneFile, AnUnknownPoseIsSaid) {
  const std::string text = scene_text(one_sensor(dir_.path(), "cam"), dir_.path());
  EXPECT_THAT(text, AllOf(HasSubstr("# Not known: the identity"), HasSubstr("# up: ")));
  EXPECT_THAT(problems(text), IsEmpty());
}

TEST_F(SceneFile, SeveralRecordingsBecomeOneRig) {
  ImportedScene second = one_sensor(dir_.path(), "cam");
  second.fps = 60, second.up = Vec3d{0, 0, 1}, second.notes = {"a", "b"};
  ImportedScene first = one_sensor(dir_.path(), "cam");
  first.notes = {"a"};
  const ImportedScene rig = one_scene({first, second, one_sensor(dir_.path(), "cam")});
  ASSERT_EQ(rig.sensors.size(), 3u);
  EXPECT_EQ(rig.sensors[1].id, "cam-2");
  EXPECT_EQ(rig.sensors[2].id, "cam-3");
  EXPECT_EQ(rig.fps, 60);
  EXPECT_EQ(rig.up, (Vec3d{0, 0, 1}));
  EXPECT_THAT(rig.notes,
              testing::ElementsAre("a", "b", testing::StartsWith("3 sensors have no pose")));
  EXPECT_THAT(problems(scene_text(rig, dir_.path())), IsEmpty());
}

TEST_F(SceneFile, FoldersOfDataSetsBecomeScenesThatLoad) {
  const std::string depth = test::depth_png(Image<std::uint16_t, 1>(64, 48, 5000));
  const auto pose = [](int i) {
    return "1 0 0 " + std::to_string(i) + "\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  };
  for (int i = 0; i < 2; ++i) {
    const std::string number = std::to_string(i);
    dir_.write("seven/frame-00000" + number + ".depth.png", depth);
    dir_.write("seven/frame-00000" + number + ".pose.txt", pose(i));
    dir_.write("redwood/depth/00000" + number + ".png", depth);
    dir_.write("views/depth_" + number + ".png", depth);
    dir_.write("views/pose_" + number + ".txt", pose(i));
    dir_.write("tum/depth/" + number + ".png", depth);
    dir_.write("tum/rgb/" + number + ".png", test::png_file(64, 48, 8, 2, ""));
  }
  for (const char* folder : {"seven", "views"})
    dir_.write(std::string(folder) + "/camera-intrinsics.txt", "58 0 32\n0 58 24\n0 0 1\n");
  std::filesystem::create_directories(dir_ / "redwood/color");
  dir_.write("redwood/camera.json",
             R"({"width": 64, "height": 48, "intrinsic_matrix": [58, 0, 0, 0, 58, 0, 32, 24, 1]})");
  dir_.write("redwood/trajectory.log", "0 0 1\n" + pose(0) + "1 1 2\n" + pose(1));
  for (const auto& [folder, sensors] : {std::pair("seven", 1), {"redwood", 1}, {"views", 2}}) {
    const sensor::RecordingFormat* format = sensor::recognize(dir_ / folder);
    ASSERT_TRUE(format) << folder;
    const auto scene = format->import(dir_ / folder);
    ASSERT_TRUE(scene) << scene.error().message;
    const SceneResult read = load(scene_text(*scene, dir_.path()));
    EXPECT_THAT(shorten(read.problems), IsEmpty()) << folder;
    EXPECT_THAT(shorten(read.notices), IsEmpty()) << folder;
    ASSERT_EQ(read.scene.sensors.size(), static_cast<std::size_t>(sensors)) << folder;
    const Pose last = sensors == 2 ? read.scene.sensors[1].T_world_depth.at(0)
                                   : read.scene.sensors[0].T_world_depth.at(1);
    EXPECT_EQ(last.translation.x, 1) << folder;
  }

  dir_.write("tum/rgb.txt", "1000.01 rgb/0.png\n1000.05 rgb/1.png\n");
  dir_.write("tum/depth.txt", "1000.00 depth/0.png\n1000.04 depth/1.png\n");
  dir_.write("tum/groundtruth.txt", "1000 0 0 0 0 0 0 1\n1000.04 1 0 0 0 0 0 1\n");
  const std::string tum =
      "scene: s\nsensors:\n  - id: a\n    source: {type: tum, folder: tum}\n"
      "    depth_camera: {size: [64, 48], fx: 58, fy: 58, cx: 32, cy: 24}\n"
      "    color_camera: {size: [64, 48], fx: 58, fy: 58, cx: 32, cy: 24}\n"
      "    T_world_depth: {trajectory: tum/groundtruth.txt}\n";
  const SceneResult read = load(tum);
  EXPECT_THAT(shorten(read.problems), IsEmpty());
  const SensorConfig& config = read.scene.sensors.at(0);
  const auto clock = config.source.clock();
  ASSERT_TRUE(clock);
  EXPECT_NEAR(config.pose_of(0, clock->first + std::chrono::milliseconds(10))->translation.x, 0.25,
              1e-6);
  dir_.write("tum/groundtruth.txt", "1100 0 0 0 0 0 0 1\n1100.04 1 0 0 0 0 0 1\n");
  EXPECT_THAT(problems(tum), testing::ElementsAre(AllOf(
                                 HasSubstr("7: T_world_depth: "), HasSubstr("groundtruth.txt"),
                                 HasSubstr("but the recording begins at 1000.0"))));
  // A folder that is missing is told once.
  std::filesystem::remove_all(dir_ / "tum");
  EXPECT_THAT(problems(tum), testing::ElementsAre(
                                 AllOf(HasSubstr("no folder"), HasSubstr("tum', where 2 files"))));
}

}  // namespace
}  // namespace mr
