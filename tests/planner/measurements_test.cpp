#include <gtest/gtest.h>

#include "mr/node/sources.h"
#include "mr/planner/merge_costs.h"
#include "mr/planner/planner.h"
#include "mr/planner/sensor_sample.h"

namespace mr {
namespace {

using planner::MergeCosts;
using planner::SensorSample;

TEST(PlannerMeasurements, CostsAndSamplesAreMeasured) {
  Scene scene;
  scene.id = "rig";
  scene.voxel_m = 0.04, scene.fusion.truncation_m = 0.16, scene.simplify.ratio = 0.2;
  RigConfig rig;
  rig.sensors = 2;
  rig.depth_width = 320, rig.depth_height = 288;
  rig.color_width = 160, rig.color_height = 90;
  scene.rig = rig;
  scene.mergers = {{.id = "root", .inputs = rig.sensor_ids(), .deadline_ms = 50}};
  scene = *node::prepare_scene(scene);
  const MergeCosts costs = planner::measure_merge_costs(scene);
  for (const double ns : {costs.decode_ns, costs.merge_ns, costs.code_ns}) {
    EXPECT_GT(ns, 1);
    EXPECT_LT(ns, 1e6);
  }
  EXPECT_GE(costs.overlap_ns, 0);
  EXPECT_GT(costs.memory_bytes, 50);
  EXPECT_LT(costs.memory_bytes, 20'000);
  EXPECT_GT(costs.coded_bytes, 0.5);
  EXPECT_LT(costs.coded_bytes, 20);

  const auto samples = planner::sample_sensors(scene, {}, {});
  ASSERT_EQ(samples.size(), 2u);
  for (const SensorSample& sample : samples) {
    EXPECT_NE(sample.triangles, 10'000);
    EXPECT_GT(sample.triangles, 500);
    EXPECT_GT(sample.area_m2, 3);
    EXPECT_GT(sample.reconstruct_ms, 0);
    EXPECT_FALSE(sample.surface.empty());
    EXPECT_FALSE(sample.depth.empty());
  }
  const auto some = planner::sample_sensors(scene, {}, {.most_sensors = 1});
  EXPECT_EQ(some[0].triangles, some[1].triangles);
  EXPECT_TRUE(some[0].surface.empty());

  const auto plan = planner::make_plan(scene, samples, costs, {.mergers = 1});
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->mergers[0].triangles_in, samples[0].triangles + samples[1].triangles);
  EXPECT_GT(plan->one_grid.memory_mb, 0);
  EXPECT_GT(plan->one_grid.dense_memory_mb, plan->one_grid.memory_mb);
}

}  // namespace
}  // namespace mr
