#include "mr/planner/planner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "mr/core/parallel.h"
#include "mr/planner/scene_text.h"
#include "planner/plans.h"

namespace mr {
namespace {

using planner::Plan;
using planner::PlannedMerger;
using planner::SensorSample;
using planner::Split;
using test::kCosts;
using test::plan_of;
using test::ring;
using test::scene_of;
using test::sensor;
using testing::ElementsAre;
using testing::HasSubstr;

std::multiset<std::string> sensor_inputs(const Plan& plan) {
  std::multiset<std::string> out;
  for (const PlannedMerger& merger : plan.mergers)
    if (merger.layer == 1) out.insert(merger.config.inputs.begin(), merger.config.inputs.end());
  return out;
}

TEST(Planner, TwoRoomsAreSplitByRoom) {
  std::vector<SensorConfig> sensors;
  const auto east = ring("east-", {30, 0, 1}, 4), west = ring("west-", {0, 0, 1}, 4);
  for (int i = 0; i < 4; ++i) sensors.push_back(east[i]), sensors.push_back(west[i]);
  const auto plan = plan_of(scene_of(sensors), 2);
  ASSERT_TRUE(plan) << plan.error().message;
  ASSERT_EQ(plan->mergers.size(), 3u);
  EXPECT_EQ(plan->split, Split::sensors);
  EXPECT_EQ(plan->layers, 2);
  EXPECT_THAT(plan->mergers[0].config.inputs, ElementsAre("east-0", "east-1", "east-2", "east-3"));
  EXPECT_THAT(plan->mergers[1].config.inputs, ElementsAre("west-0", "west-1", "west-2", "west-3"));
  const PlannedMerger& root = plan->mergers[2];
  EXPECT_EQ(root.config.id, "root");
  EXPECT_THAT(root.config.inputs,
              ElementsAre(plan->mergers[0].config.id, plan->mergers[1].config.id));
  EXPECT_EQ(root.triangles_shared, 0);  // rooms have nothing in common
  EXPECT_NEAR(root.triangles_in, root.triangles_out, 1e-6);
}

TEST(Planner, RoomsOfDifferentSizesAreNotTornApart) {
  auto sensors = ring("hall-", {0, 0, 1}, 6);
  for (const SensorConfig& s : ring("cell-", {30, 0, 1}, 3)) sensors.push_back(s);
  const auto plan = plan_of(scene_of(sensors), 2);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->mergers[0].config.inputs.size(), 6u);
  EXPECT_THAT(plan->mergers[1].config.inputs, ElementsAre("cell-0", "cell-1", "cell-2"));
}

TEST(Planner, EverySensorIsInOneGroup) {
  std::mt19937 random(5);
  std::uniform_real_distribution<> along(0, 20), across(0, 6);
  std::vector<SensorConfig> sensors;
  for (int i = 0; i < 13; ++i) {
    const Vec3d eye{along(random), across(random), 2};
    sensors.push_back(sensor("s" + std::to_string(i), eye, {along(random), across(random), 1}));
  }
  const Scene scene = scene_of(sensors);
  for (int mergers = 1; mergers <= 13; ++mergers) {
    const auto plan = plan_of(scene, mergers, Split::sensors);
    ASSERT_TRUE(plan) << plan.error().message;
    EXPECT_EQ(plan->mergers.size(), mergers == 1 ? 1u : static_cast<std::size_t>(mergers) + 1);
    const auto inputs = sensor_inputs(*plan);
    EXPECT_EQ(inputs.size(), 13u);
    EXPECT_EQ(std::set<std::string>(inputs.begin(), inputs.end()).size(), 13u);
    EXPECT_EQ(plan->mergers.back().config.id, "root");
  }
}

/// Two sensors that see the very same.
TEST(Planner, WhatTwoSensorsSeeStaysOnce) {
  const Scene scene =
      scene_of({sensor("a", {0, 0, 1}, {3, 0, 1}), sensor("b", {0, 0, 1}, {3, 0, 1}),
                sensor("c", {0, 0, 1}, {-3, 0, 1})});
  std::vector<SensorSample> samples(3);
  samples[2].triangles = 4'000;
  const auto plan = planner::make_plan(scene, samples, kCosts, {.mergers = 1, .link_ms = 2});
  ASSERT_TRUE(plan) << plan.error().message;
  const PlannedMerger& root = plan->mergers.at(0);
  EXPECT_NEAR(root.triangles_in, 24'000, 1e-6);
  EXPECT_NEAR(root.triangles_shared, 20'000, 1e-6);
  EXPECT_NEAR(root.triangles_out, 14'000, 1e-6);
  EXPECT_NEAR(root.latency_ms, 24 * 1.0 + 20 * 0.5 + 14 * 0.4, 1e-6);
  EXPECT_NEAR(root.memory_mb, 24'000 * 600e-6, 1e-6);
  EXPECT_NEAR(plan->latency_ms, root.latency_ms + 2, 1e-6);
  EXPECT_NEAR(plan->central.latency_ms, root.latency_ms, 1e-6);
}

TEST(Planner, TwoGroupsOfTheSameOverlapAtTheRoot) {
  const Scene scene =
      scene_of({sensor("a", {0, 0, 1}, {3, 0, 1}), sensor("b", {0, 0, 1}, {3, 0, 1})});
  const auto plan = plan_of(scene, 2, Split::sensors);
  ASSERT_TRUE(plan) << plan.error().message;
  const PlannedMerger& root = plan->mergers.back();
  EXPECT_NEAR(root.triangles_in, 20'000, 1e-6);
  EXPECT_NEAR(root.triangles_shared, 20'000, 1e-6);
  EXPECT_NEAR(root.triangles_out, 10'000, 1e-6);
  EXPECT_NEAR(plan->latency_ms, 10 * 1.4 + 20 * 1.5 + 10 * 0.4 + 2, 1e-6);
}

TEST(Planner, AStatedLinkTakesTimeForItsBytes) {
  Scene scene = scene_of({sensor("a", {0, 0, 1}, {3, 0, 1})});
  const double fast_ms = plan_of(scene, 1)->latency_ms;
  scene.links = {{"a", "root", 4}};  // 20 kB at 4 Mbit/s: 40 ms
  const auto plan = plan_of(scene, 1);
  EXPECT_NEAR(plan->latency_ms, fast_ms + 40, 1e-6);
  EXPECT_NEAR(plan->links_ms, 41, 1e-6);
}

/// What one sensor sees of another's surface follows from its picture, where there is one: a wall
/// hides what is behind it.
TEST(Planner, PicturesTellWhatIsHidden) {
  const Scene scene =
      scene_of({sensor("a", {0, 0, 1}, {3, 0, 1}), sensor("b", {0, 0, 1}, {3, 0, 1})});
  std::vector<SensorSample> samples(2);
  for (int i = 0; i < 2; ++i) {  // a sees a wall at 1 m, b one at 3 m
    const float depth_m = i == 0 ? 1.0f : 3.0f;
    samples[i].depth = ImageDepth(320, 288, depth_m);
    samples[i].T_world_depth = scene.sensors[i].T_world_depth[0];
    for (int k = 0; k < 200; ++k)
      samples[i].surface.push_back({depth_m, 0.002f * static_cast<float>(k) - 0.2f, 1});
  }
  const auto plan = planner::make_plan(scene, samples, kCosts, {.mergers = 1});
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->mergers[0].triangles_shared, 0);
  samples[0].depth = ImageDepth(320, 288, 3.0f);
  samples[0].surface = samples[1].surface;
  const auto same = planner::make_plan(scene, samples, kCosts, {.mergers = 1});
  EXPECT_NEAR(same->mergers[0].triangles_out, 10'000, 1e-6);
}

/// The boxes of a plan's regions, in cubes.
std::vector<std::pair<Vec3i, Vec3i>> regions_of(const Plan& plan, double chunk_m) {
  std::vector<std::pair<Vec3i, Vec3i>> out;
  const auto cube = [&](Vec3d p) {
    const Vec3d c = p / chunk_m;
    const Vec3i whole{static_cast<int>(std::lround(c.x)), static_cast<int>(std::lround(c.y)),
                      static_cast<int>(std::lround(c.z))};
    EXPECT_LT(length(c - vec_cast<double>(whole)), 1e-6);
    return whole;
  };
  for (const PlannedMerger& merger : plan.mergers)
    if (merger.config.region)
      out.emplace_back(cube(merger.config.region->low), cube(merger.config.region->high));
  return out;
}

TEST(Planner, RegionsTileTheSpaceAndHaveTheSensorsThatSeeThem) {
  Scene scene = scene_of(ring("cam-", {1, 2, 1}, 12));
  scene.fusion.chunk_m = 0.64;
  for (const int mergers : {2, 3, 5, 8}) {
    const auto plan = plan_of(scene, mergers, Split::space);
    ASSERT_TRUE(plan) << plan.error().message;
    const auto regions = regions_of(*plan, 0.64);
    ASSERT_EQ(regions.size(), static_cast<std::size_t>(mergers));
    for (const SensorConfig& s : scene.sensors)
      for (double depth = 0.4; depth <= 4; depth += 0.3)
        for (const Vec2d pixel : {Vec2d{0, 0}, Vec2d{319, 0}, Vec2d{160, 144}, Vec2d{0, 287}}) {
          const Vec3d p = s.T_world_depth[0] * (unproject(s.depth_camera, pixel) * depth);
          int owners = 0;
          for (std::size_t r = 0; r < regions.size(); ++r) {
            const Box3d& box = *plan->mergers[r].config.region;
            if (p.x < box.low.x || p.y < box.low.y || p.z < box.low.z) continue;
            if (p.x >= box.high.x || p.y >= box.high.y || p.z >= box.high.z) continue;
            ++owners;
            EXPECT_THAT(plan->mergers[r].config.inputs, testing::Contains(s.id));
          }
          ASSERT_EQ(owners, 1) << p.x << " " << p.y << " " << p.z;
        }
    EXPECT_EQ(plan->mergers.back().triangles_shared, 0);
  }
}

TEST(Planner, ACrowdOfSensorsIsSplitBySpace) {
  Scene scene = scene_of(ring("cam-", {0, 0, 1}, 16));
  scene.fusion.chunk_m = 0.32;
  const auto plan = plan_of(scene, 4);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->split, Split::space) << plan->why;
  EXPECT_THAT(plan->why, HasSubstr("crowd"));
  // All in one cube: split by groups, and `why` states it.
  scene = scene_of(ring("cam-", {50, 50, 50}, 16));
  scene.fusion.chunk_m = 100;
  const auto coarse = plan_of(scene, 4);
  ASSERT_TRUE(coarse) << coarse.error().message;
  EXPECT_EQ(coarse->split, Split::sensors);
  EXPECT_THAT(coarse->why, HasSubstr("too few cubes"));
  EXPECT_FALSE(plan_of(scene, 16, Split::space));
}

TEST(Planner, ACrowdThatIsSplitBySensorsHasMoreLayers) {
  std::vector<SensorConfig> same;
  for (int i = 0; i < 32; ++i)
    same.push_back(sensor("s" + std::to_string(i), {0, 0, 1}, {3, 0, 1}));
  const auto plan = plan_of(scene_of(same), 16, Split::sensors);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->layers, 3);
  EXPECT_EQ(plan->mergers.size(), 17u);
  EXPECT_EQ(sensor_inputs(*plan).size(), 32u);
  EXPECT_LT(plan->latency_ms, plan_of(scene_of(same), 2, Split::sensors)->latency_ms);
}

TEST(Planner, SameTreeOnAnyNumberOfThreads) {
  Scene scene = scene_of(ring("cam-", {0, 0, 1}, 40));
  for (const Split split : {Split::sensors, Split::space}) {
    std::string blocks[2];
    for (int i = 0; i < 2; ++i) {
      Arena arena(i == 0 ? 1 : 8);
      arena.run([&] { blocks[i] = planner::mergers_block(*plan_of(scene, 6, split)); });
    }
    EXPECT_EQ(blocks[0], blocks[1]);
    EXPECT_FALSE(blocks[0].empty());
  }
}

TEST(Planner, RefusesWhatCannotBe) {
  const Scene scene = scene_of(ring("cam-", {0, 0, 1}, 3));
  EXPECT_THAT(plan_of(scene, 0).error().message, HasSubstr("at least 1"));
  EXPECT_THAT(plan_of(scene, 4).error().message, HasSubstr("more than the scene's 3 sensors"));
  EXPECT_FALSE(planner::make_plan(scene, {}, kCosts, {}));
  EXPECT_FALSE(planner::make_plan(Scene{}, {}, kCosts, {}));
  Scene nothing = scene;  // no sensor sees any of it
  nothing.volume = Box3d{{100, 100, 100}, {101, 101, 101}};
  const auto blind = plan_of(nothing, 2);
  ASSERT_TRUE(blind) << blind.error().message;
  EXPECT_EQ(sensor_inputs(*blind).size(), 3u);
  EXPECT_EQ(blind->mergers.back().triangles_in, 0);
}

}  // namespace
}  // namespace mr
