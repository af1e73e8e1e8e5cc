#include "mr/eval/still_error.h"

#include "mr/eval/sensor_coverage.h"
#include "small_scene.h"
#include "support/meshes.h"

namespace mr::eval {
namespace {

/// A square of side 2 in the plane z, facing up.
Mesh square_at(float z) {
  Mesh mesh;
  mesh.positions = {{-1, -1, z}, {1, -1, z}, {1, 1, z}, {-1, 1, z}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

TEST(StillTriangles, AreThoseThatAreTheSameInBoth) {
  Mesh now = square_at(0), before = square_at(0);
  append(now, square_at(1));
  append(before, square_at(2));
  append(before, square_at(3));
  EXPECT_EQ(still_triangles(now, before), (std::vector<std::uint8_t>{1, 1, 0, 0}));
  EXPECT_EQ(still_triangles(before, now), (std::vector<std::uint8_t>{1, 1, 0, 0, 0, 0}));
}

TEST(DistanceToMarked, LeavesOutWhatIsNearestToTheRest) {
  Mesh truth = square_at(0);
  append(truth, square_at(1));
  Mesh shown = square_at(0.02f);
  append(shown, square_at(0.9f));
  const std::vector<std::uint8_t> lower{1, 1, 0, 0}, all(4, 1);
  EXPECT_NEAR(distance_to_marked(shown, truth, lower, 10'000, 1).rms_mm, 20, 1e-3);
  EXPECT_NEAR(distance_to_marked(shown, truth, all, 10'000, 1).max_mm, 100, 1e-3);
}

/// Measured after `captures`, with and without layers.
struct StillPair {
  StillError layers, anew;
};
StillPair measure_both(const std::string& rig, int captures) {
  SmallScene small(rig, "still: {layers: true}\n");
  const auto plan = read_viewpoints(viewpoints_file(small.scene), viewpoints_key(small.scene));
  EXPECT_TRUE(plan.ok());
  StillErrorConfig config;
  config.captures = captures, config.pairs = 2, config.samples = 400'000;
  config.rig_cache = small.config().rig_cache;
  StillPair out;
  for (StillError* error : {&out.layers, &out.anew}) {
    auto measured = still_error(small.scene, plan->views, config);
    if (measured)
      *error = *measured;
    else
      ADD_FAILURE() << measured.error().message;
    small.scene.still.layers = false;
  }
  return out;
}

TEST(StillErrorOfARig, AnEmptyRoomStandsStillWithLayers) {
  const auto [layers, anew] = measure_both("", 30);
  EXPECT_TRUE(layers.layers);
  EXPECT_FALSE(anew.layers);
  EXPECT_EQ(layers.views, 4);
  EXPECT_EQ(layers.first_s, 0);
  EXPECT_GT(layers.pairs, 0);
  EXPECT_GT(anew.changed_ratio, 1e-4) << "noise";
  EXPECT_LT(layers.changed_ratio, 0.2 * anew.changed_ratio);
  EXPECT_LT(layers.still.all.rms_mm, 1.2 * anew.still.all.rms_mm)
      << "no farther than a 3 cm grid lets it be";
  EXPECT_LT(layers.still.wall.rms_mm, 1.2 * anew.still.wall.rms_mm);
  EXPECT_NEAR(layers.anew.all.rms_mm, anew.still.all.rms_mm, 0.2) << "the same capture";
  EXPECT_EQ(layers.hidden_ratio, 0) << "nobody hides anything";
  EXPECT_LT(layers.hidden_missing, 0.3);
}

TEST(StillErrorOfARig, WhatSomebodyHidesIsMissingWithoutLayers) {
  const auto [layers, anew] = measure_both(", people: 2, frames: 300", 40);
  EXPECT_GT(anew.hidden_ratio, 0);
  EXPECT_LT(anew.hidden_ratio, 0.5);
  EXPECT_EQ(layers.hidden_ratio, anew.hidden_ratio);
  EXPECT_GT(anew.hidden_now_missing, 2 * anew.hidden_missing);
}

TEST(StillErrorOfARig, WantsATruth) {
  SmallScene small;
  small.scene.rig.reset();
  const auto error = still_error(small.scene, {}, {});
  ASSERT_FALSE(error.ok());
  EXPECT_EQ(error.error().cause, Error::Cause::unsupported);
}

TEST(Captured, EyesStandWhereTheyReallyDo) {
  const SmallScene small(", calib_error_mm: 20");
  const auto frustums = sensor_frustums(small.scene);
  ASSERT_EQ(frustums.size(), small.scene.sensors.size());
  const Pose& stated = small.scene.sensors[1].T_world_depth.front();
  const double off_m = length(frustums[1].T_world_depth.translation - stated.translation);
  EXPECT_GT(off_m, 0.001);
  EXPECT_LT(off_m, 0.2);
}

}  // namespace
}  // namespace mr::eval
