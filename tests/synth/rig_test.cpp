#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <numeric>

#include "core/temp_dir.h"
#include "mr/core/parallel.h"
#include "mr/scene/scene.h"
#include "mr/sensor/rgbd_images.h"
#include "mr/synth/export_rig.h"
#include "mr/synth/floor_plan.h"
#include "mr/synth/furniture.h"
#include "mr/synth/rig_errors.h"
#include "mr/synth/room.h"
#include "mr/synth/truth.h"

namespace mr::synth {
namespace {

/// Small pictures of two people in the default room.
RigConfig busy_rig() {
  RigConfig rig;
  rig.sensors = 2, rig.people = 2;
  rig.depth_width = 160, rig.depth_height = 144;
  rig.color_width = 160, rig.color_height = 90;
  rig.frames = 3;
  rig.loop = true;
  return rig;
}

std::vector<std::unique_ptr<FrameSource>> open_all(const RigConfig& rig,
                                                   const RigCache& cache = {}) {
  const std::vector<SensorConfig> sensors = rig_sensors(rig);
  const std::vector<SensorId> all = all_sensors(sensors);
  return open_rig(rig, sensors, all, 30, cache);
}

std::vector<Frame> read(FrameSource& source, int count) {
  std::vector<Frame> frames;
  for (int i = 0; i < count; ++i) {
    auto frame = source.next();
    if (frame && *frame) frames.push_back(std::move(**frame));
  }
  return frames;
}

void expect_same(const std::vector<Frame>& a, const std::vector<Frame>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].depth, b[i].depth) << i;
    EXPECT_EQ(a[i].color, b[i].color) << i;
    EXPECT_EQ(a[i].index, b[i].index);
    EXPECT_EQ(a[i].captured_at(), b[i].captured_at());
  }
}

/// The files of a cache.
std::vector<std::filesystem::path> cached_files(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files.push_back(entry.path());
  return files;
}

TEST(Rig, LoopsSeamlesslySkipsAndMoves) {
  const RigConfig rig = busy_rig();
  std::vector<std::vector<Frame>> runs;
  for (const int threads : {1, 8})
    Arena(threads).run([&] {
      const auto source = std::move(open_all(rig)[0]);
      EXPECT_TRUE(source->endless());
      runs.push_back(read(*source, 5));
      source->skip(3);
      runs.push_back(read(*source, 1));
    });
  expect_same(runs[0], runs[2]);  // on 1 and 8 threads
  const std::vector<Frame>& frames = runs[0];
  EXPECT_NE(frames[0].color, frames[1].color);
  EXPECT_EQ(frames[0].color, frames[3].color);
  EXPECT_EQ(frames[0].depth, frames[3].depth);
  EXPECT_EQ(frames[3].index, 3u);
  EXPECT_EQ(frames[3].captured_at(), TimePoint(std::chrono::milliseconds(100)));
  EXPECT_EQ(runs[1][0].index, 8u);
  EXPECT_EQ(runs[1][0].depth, frames[2].depth);
}

TEST(Rig, WhatWasCachedEqualsWhatIsRendered) {
  const test::TempDir cache;
  const RigConfig rig = busy_rig();
  const auto rendered = open_all(rig);
  std::vector<std::vector<Frame>> expected;
  for (const auto& source : rendered) expected.push_back(read(*source, 4));
  const auto check = [&](const RigCache& how) {
    const auto sources = open_all(rig, how);
    for (std::size_t i = 0; i < sources.size(); ++i) expect_same(read(*sources[i], 4), expected[i]);
  };
  int told = 0;
  check({cache.path(), [&](int done, int of) { told = done * 100 / of; }});
  EXPECT_EQ(told, 100);
  check({cache.path(), {}});  // from the cache

  // Damaged and cut off files are noticed and made whole again.
  const auto files = cached_files(cache.path());
  ASSERT_EQ(files.size(), 2u);
  const auto whole = std::filesystem::file_size(files[0]);
  std::filesystem::resize_file(files[0], whole - 1000);
  std::fstream(files[1], std::ios::in | std::ios::out | std::ios::binary).seekp(60'000) << "damage";
  check({cache.path(), {}});
  EXPECT_EQ(std::filesystem::file_size(files[0]), whole);
  std::filesystem::resize_file(files[0], 10);
  check({cache.path(), {}});
}

TEST(Rig, StatedPosesAreOffByTheInjectedError) {
  RigConfig rig = busy_rig();
  rig.sensors = 20;
  const std::vector<SensorConfig> exact = exact_sensors(rig);
  EXPECT_EQ(rig_sensors(rig)[3].T_world_depth, exact[3].T_world_depth);
  rig.calib_error_mm = 7, rig.calib_error_deg = 0.5;
  const std::vector<SensorConfig> stated = rig_sensors(rig);
  for (std::size_t i = 0; i < stated.size(); ++i) {
    const Pose off = exact[i].T_world_depth[0].inverse() * stated[i].T_world_depth[0];
    const double trace = off.rotation(0, 0) + off.rotation(1, 1) + off.rotation(2, 2);
    EXPECT_NEAR(length(off.translation), 0.007, 1e-9);
    EXPECT_NEAR(std::acos((trace - 1) / 2) * 180 / std::numbers::pi, 0.5, 1e-6);
  }
}

TEST(Rig, ExposureAndWhiteBalanceDifferWithinTheirSpread) {
  RigConfig rig = busy_rig();
  EXPECT_EQ(exposure_gain(rig, 0), (Vec3f{1, 1, 1}));
  rig.exposure_spread = 0.5;
  double least = 9, most = -9, tint = 0;
  for (std::uint32_t i = 0; i < 50; ++i) {
    const Vec3f gain = exposure_gain(rig, i);
    least = std::min(least, std::log2(double{gain.y}));
    most = std::max(most, std::log2(double{gain.y}));
    tint = std::max(tint, std::abs(std::log2(double{gain.x / gain.y})));
  }
  EXPECT_TRUE(least > -0.5 && least < -0.3 && most < 0.5 && most > 0.3);
  EXPECT_TRUE(tint <= 0.1251 && tint > 0.05);

  rig.people = 0;
  const auto bright = read(*open_all(rig)[0], 1);
  rig.exposure_spread = 0;
  const auto neutral = read(*open_all(rig)[0], 1);
  EXPECT_NE(bright[0].color, neutral[0].color);
}

TEST(Rig, ClockErrorsMoveWhatIsSeenNotWhatIsStated) {
  RigConfig rig = busy_rig();
  rig.sensors = 1;
  const auto exact = read(*open_all(rig)[0], 1);
  rig.clock_offset_ms = 50;
  EXPECT_LE(std::abs(clock_error_s(rig, 0)), 0.05);
  EXPECT_NE(clock_error_s(rig, 0), clock_error_s(rig, 1));
  const auto off = read(*open_all(rig)[0], 1);
  EXPECT_EQ(off[0].captured_at(), exact[0].captured_at());
  EXPECT_NE(off[0].color, exact[0].color);
}

TEST(Rig, ManyCamerasHangInFreeSpace) {
  using Kind = RigConfig::Kind;
  RigConfig rig;
  const Pose T_room_world = room_pose().inverse();
  for (const Kind kind :
       {Kind::room, Kind::conference, Kind::office, Kind::corridor, Kind::hallway})
    for (const int count : {1, 4, 16, 400}) {
      rig.kind = kind, rig.room_m = usual_room_m(kind), rig.sensors = count, rig.lidars = 1;
      const FloorPlan plan(rig, build_room(rig).blocks);
      const std::vector<SensorConfig> sensors = rig_sensors(rig);
      ASSERT_EQ(sensors.size(), static_cast<std::size_t>(count + 1));
      for (const SensorConfig& sensor : sensors) {
        EXPECT_TRUE(sensor.depth_camera.problems().empty());
        const Vec3d eye = T_room_world * sensor.T_world_depth[0].translation;
        EXPECT_GT(plan.clearance_m(eye), 0.1) << sensor.id << " of " << count;
      }
    }
}

TEST(Rig, PeopleWalkWhereNothingStands) {
  using Kind = RigConfig::Kind;
  RigConfig rig;
  rig.people = 2;
  for (const Kind kind :
       {Kind::room, Kind::conference, Kind::office, Kind::corridor, Kind::hallway}) {
    rig.kind = kind, rig.room_m = usual_room_m(kind);
    const FloorPlan plan(rig, build_room(rig).blocks);
    const std::vector<Walk> walks = plan_walks(rig, plan);
    ASSERT_EQ(walks.size(), 2u);
    for (const Walk& walk : walks)
      for (int i = 0; i < 36; ++i) {
        const double a = i * std::numbers::pi / 18;
        const Vec2d p{walk.center.x + walk.radius.x * std::cos(a),
                      walk.center.y + walk.radius.y * std::sin(a)};
        EXPECT_GT(plan.walking_clearance_m(p), 0.3);
      }
  }
}

TEST(Rig, LidarRangesAgreeWithTheWalls) {
  RigConfig rig;
  rig.sensors = 1, rig.lidars = 1, rig.noise = false, rig.frames = 1;
  SensorConfig sensor = rig_sensors(rig).at(1);
  EXPECT_EQ(sensor.id, "lidar-0");
  EXPECT_EQ(sensor.color_camera->width, 2048);
  sensor.color_camera.reset();
  const SensorId wanted[] = {SensorId{0}};
  const Frame frame = read(*open_rig(rig, {&sensor, 1}, wanted, 30, {})[0], 1).at(0);
  EXPECT_EQ(frame.depth.width, 2048);
  EXPECT_EQ(frame.depth.height, 128);
  EXPECT_EQ(frame.exposure_end - frame.exposure_start, std::chrono::milliseconds(100));
  const Pose T_room_lidar = room_pose().inverse() * sensor.T_world_depth[0];
  const Vec3d eye = T_room_lidar.translation, half{3, 2.5, 0};
  int on_wall = 0;
  for (int x = 0; x < frame.depth.width; ++x) {  // the first beams meet walls above the furniture
    const Vec3d ray = T_room_lidar.rotation * unproject(sensor.depth_camera, {double(x), 0});
    const double exit = std::min((std::copysign(half.x, ray.x) - eye.x) / ray.x,
                                 (std::copysign(half.y, ray.y) - eye.y) / ray.y);
    on_wall += std::abs(*frame.depth.at(x, 0) - exit) < 6e-4;
  }
  EXPECT_GT(on_wall, 1900);
  EXPECT_NEAR(*frame.depth.at(1000, 127), eye.z, 0.8);  // straight down, perhaps onto the table
}

TEST(Rig, LidarsMayBeAloneAndSparseAndAreAsNoisyAsTheySay) {
  RigConfig rig;
  rig.sensors = 0, rig.lidars = 1, rig.lidar_beams = 32, rig.lidar_noise_mm = 20, rig.frames = 2;
  EXPECT_TRUE(rig.problems().empty());
  std::vector<SensorConfig> sensors = rig_sensors(rig);
  ASSERT_EQ(sensors.size(), 1u);
  EXPECT_EQ(sensors[0].id, "lidar-0");
  EXPECT_EQ(sensors[0].depth_camera.height, 32);
  EXPECT_EQ(sensors[0].precision, (Precision{.base_m = 0.02, .per_m2 = 0}));
  sensors[0].color_camera.reset();
  const SensorId wanted[] = {SensorId{0}};
  const std::vector<Frame> frames = read(*open_rig(rig, sensors, wanted, 30, {})[0], 2);
  std::vector<double> changes;
  for (std::size_t i = 0; i < frames[0].depth.data.size(); ++i)
    if (frames[0].depth.data[i] > 0 && frames[1].depth.data[i] > 0)
      changes.push_back(std::abs(frames[1].depth.data[i] - frames[0].depth.data[i]));
  const auto middle = changes.begin() + static_cast<std::ptrdiff_t>(changes.size() / 2);
  std::nth_element(changes.begin(), middle, changes.end());
  EXPECT_NEAR(*middle, 0.6745 * std::sqrt(2.0) * 0.02, 0.001);
  rig.lidars = 0;
  EXPECT_FALSE(rig.problems().empty());
}

// A lamp hangs from the middle of the ceiling.
TEST(Rig, NoLampHidesTheRoomFromALidar) {
  RigConfig rig;
  rig.seed = 2, rig.room_m = {8, 5, 3}, rig.sensors = 0, rig.lidars = 1, rig.noise = false;
  SensorConfig sensor = rig_sensors(rig).at(0);
  sensor.color_camera.reset();
  const SensorId wanted[] = {SensorId{0}};
  const Frame frame = read(*open_rig(rig, {&sensor, 1}, wanted, 30, {})[0], 1).at(0);
  const auto near = std::ranges::count_if(frame.depth.data, [](float m) { return m > 0 && m < 1; });
  EXPECT_LT(static_cast<double>(near), 0.03 * static_cast<double>(frame.depth.data.size()));
}

TEST(Rig, TheTruthIsTheSurfaceThatIsMeasured) {
  RigConfig rig = busy_rig();
  rig.noise = false;
  const std::vector<SensorConfig> sensors = rig_sensors(rig);
  const Frame frame = read(*open_all(rig)[0], 1).at(0);
  Truth truth(rig, 30);
  const TruthPicture picture =
      truth.render(sensors[0].depth_camera, sensors[0].T_world_depth[0], 0);
  int same = 0, seen = 0;
  for (std::size_t i = 0; i < frame.depth.data.size(); ++i) {
    if (frame.depth.data[i] == 0) continue;
    ++seen;
    same += frame.depth.data[i] == picture.depth.data[i];
  }
  EXPECT_EQ(same, seen);
  const ColoredMesh surface = truth.surface(0);
  EXPECT_EQ(surface.colors.size(), surface.mesh.positions.size());
  EXPECT_NE(surface.mesh, truth.surface(1).mesh);
}

TEST(Rig, WritesASceneThatSaysWhatItIs) {
  const test::TempDir folder;
  RigConfig rig = busy_rig();
  rig.depth_width = 320, rig.depth_height = 288;
  rig.frames = 2, rig.lidars = 1, rig.calib_error_mm = 5;
  ASSERT_TRUE(export_rig({rig, 30, folder.path(), {}}));
  const SceneResult loaded = load_scene(folder / "scene.yaml");
  for (const SceneProblem& problem : loaded.problems) ADD_FAILURE() << to_string(problem);
  ASSERT_EQ(loaded.scene.sensors.size(), 3u);
  const std::vector<SensorConfig> sensors = rig_sensors(rig);
  const auto rendered = open_all(rig);
  for (std::uint32_t i = 0; i < sensors.size(); ++i) {
    const SensorConfig& written = loaded.scene.sensors[i];
    if (i == 0)
      expect_same(read(*sensor::open_rgbd_images(written, SensorId{i}, {30}), 3),
                  read(*rendered[i], 3));
    EXPECT_EQ(written.id, sensors[i].id);
    EXPECT_EQ(written.color_camera, sensors[i].color_camera);
    EXPECT_EQ(written.depth_camera.model, sensors[i].depth_camera.model);
    EXPECT_LT(
        length(written.T_world_depth[0].translation - sensors[i].T_world_depth[0].translation),
        1e-12);
    EXPECT_EQ(written.source.get_if<sensor::RgbdImagesSource>()->depth.size(), 2u);
  }
  EXPECT_EQ(rig_yaml(*loaded.scene.truth->rig), rig_yaml(rig));
  EXPECT_GT(std::filesystem::file_size(folder / "truth/000001.ply"), 1'000'000u);
}

}  // namespace
}  // namespace mr::synth
