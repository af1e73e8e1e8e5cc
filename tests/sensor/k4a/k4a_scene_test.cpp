#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>

#include "core/temp_dir.h"
#include "k4a_rig.h"
#include "mr/runtime/live_frames.h"
#include "mr/runtime/live_scene.h"
#include "mr/runtime/lockstep_scene.h"
#include "mr/sensor/k4a/calibration_check.h"

namespace mr::sensor {
namespace {

using namespace std::chrono_literals;

/// Scenes of two cameras on a sync cable that look at one wall.
class K4aScene : public K4aRig {
 protected:
  K4aScene() { fake_k4a::reset(1); }
  static fake_k4a::FakeDevice streaming(const std::string& serial) {
    fake_k4a::FakeDevice out = device(serial);
    out.stream = [](std::uint64_t i) { return wall(1500, 2'000'000 + i * 33'333); };
    return out;
  }
  static Scene two_cameras() {
    Scene scene;
    scene.id = "live";
    scene.voxel_m = 0.02, scene.fusion.truncation_m = 0.08;
    for (const char* serial : {"1", "2"}) {
      K4aSource from = source(serial);
      from.sync = *serial == '1' ? K4aSource::Sync::master : K4aSource::Sync::subordinate;
      SensorConfig camera = sensor(from);
      camera.id = "s" + std::string(serial);
      camera.T_world_depth = {Pose{{}, {*serial == '1' ? 0.0 : 0.3, 0, 0}}};
      scene.sensors.push_back(camera);
    }
    scene.mergers = {{"root", {"s1", "s2"}, 50}};
    return scene;
  }
};

TEST_F(K4aScene, RunsInLockstepAtTheDevicesPace) {
  for (const char* serial : {"1", "2"}) fake_k4a::plug(streaming(serial));
  auto scene = runtime::LockstepScene::open(two_cameras());
  ASSERT_TRUE(scene.ok()) << scene.error().message;
  std::vector<std::string> dropped;
  runtime::RunListener listener;
  listener.dropped = [&](const std::string& message) { dropped.push_back(message); };
  const auto report = (*scene)->run(3, listener);
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->frames, 3);
  EXPECT_GT(report->triangles, 100u);
  EXPECT_THAT(dropped, testing::IsEmpty());
  EXPECT_THAT(report->drops, testing::IsEmpty());
}

TEST_F(K4aScene, RunsLiveAndSurvivesAnUnpluggedCamera) {
  for (const char* serial : {"1", "2"}) fake_k4a::plug(streaming(serial));
  Scene scene = two_cameras();
  scene.gateway = GatewayConfig{.listen = "127.0.0.1:0"};
  std::mutex mutex;
  std::vector<std::string> lines;
  runtime::LiveOptions options;
  options.log = [&](const LogLine& line) {
    const std::lock_guard lock(mutex);
    lines.push_back(line.node + ": " + line.text);
  };
  auto live = runtime::LiveScene::start(scene, options);
  ASSERT_TRUE(live.ok()) << live.error().message;
  const auto frames = [&](const std::string& id) {
    for (const node::NodeStats& node : (*live)->stats())
      if (node.id == id) return node.frames;
    return std::uint64_t{0};
  };
  const auto until = [&](const std::string& id, std::uint64_t count) {
    for (int i = 0; i < 3000 && frames(id) < count; ++i) std::this_thread::sleep_for(10ms);
    return frames(id);
  };
  EXPECT_GE(until("s1", 3), 3u);
  EXPECT_GE(until("s2", 3), 3u);
  fake_k4a::unplug("2");
  EXPECT_GE(until("s1", frames("s1") + 3), 3u);
  fake_k4a::plug(streaming("2"));
  const std::uint64_t before = frames("s2");
  EXPECT_GE(until("s2", before + 3), before + 3) << "it came back";
  live->reset();
  const std::lock_guard lock(mutex);
  EXPECT_THAT(lines, testing::Contains(testing::HasSubstr("s2: sensor 's2': k4a device 2: the "
                                                          "connection is lost")));
  EXPECT_THAT(lines, testing::Not(testing::Contains(testing::HasSubstr("Synchronise the clocks"))));
}

TEST_F(K4aScene, StampsArePlausibleForThisComputersClock) {
  fake_k4a::plug(streaming("1"));
  runtime::LiveFrames frames(open(sensor(source("1"))), node::wall_time);
  int got = 0;
  for (int i = 0; i < 3000 && got < 5; ++i) {
    if (!frames.is_ready({})) {
      std::this_thread::sleep_for(5ms);
      continue;
    }
    const auto captured = frames.next({}, {});
    ASSERT_TRUE(captured.ok() && *captured);
    const Duration lag = (*captured)->read_at - (*captured)->frame.captured_at();
    EXPECT_GE(lag, 0ms);
    EXPECT_LT(lag, 5s);
    ++got;
  }
  EXPECT_EQ(got, 5);
}

TEST_F(K4aScene, WhatDevicesPrintsIsASceneFile) {
  const auto calibration = *parse_kinect_calibration(fake_k4a::example_calibration());
  K4aSource from = source("000123");
  const auto lines = k4a_sensor_yaml("cam", from, calibration);
  ASSERT_TRUE(lines.ok()) << lines.error().message;
  const test::TempDir folder;
  const auto file = folder.path() / "scene.yaml";
  std::ofstream(file) << "scene: s\nsensors:\n"
                      << *lines << "  T_world_depth: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n";
  const SceneResult loaded = load_scene(file);
  ASSERT_TRUE(loaded.problems.empty()) << loaded.problems[0].message;
  SensorConfig expected = sensor(from);
  expected.depth_near_m = 0.5, expected.depth_far_m = 5.46;
  const SensorConfig& read = loaded.scene.sensors.at(0);
  EXPECT_EQ(*read.source.get_if<K4aSource>(), from);
  EXPECT_EQ(read.depth_camera, expected.depth_camera);
  EXPECT_EQ(read.color_camera, expected.color_camera);
  EXPECT_EQ(read.depth_far_m, expected.depth_far_m);
  EXPECT_NEAR(read.T_color_depth.translation.x, expected.T_color_depth.translation.x, 1e-9);
}

}  // namespace
}  // namespace mr::sensor
