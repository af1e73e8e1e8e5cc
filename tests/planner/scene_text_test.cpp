#include "mr/planner/scene_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "core/temp_dir.h"
#include "mr/node/sources.h"
#include "planner/plans.h"

namespace mr {
namespace {

using planner::PlannedMerger;
using planner::Split;
using test::plan_of;
using test::ring;
using test::scene_of;
using testing::HasSubstr;

constexpr const char* kScene = R"(scene: planned
up: [0, 0, 1]
rig: {type: synthetic, seed: 1, sensors: 6, depth_mode: nfov_binned, color: [320, 180]}
# how it was
mergers:
  - {id: west, inputs: [cam-0, cam-1, cam-2], deadline_ms: 70}
  - id: root
    inputs: [west, cam-3,
      cam-4, cam-5]
# and this
fusion: {chunk_m: 0.64}
)";

TEST(SceneText, TheSceneWithThePlansMergersLoads) {
  const test::TempDir dir;
  const auto before = load_scene(dir.write("scene.yaml", kScene));
  ASSERT_TRUE(before.problems.empty());
  const auto scene = node::prepare_scene(before.scene);
  for (const Split split : {Split::sensors, Split::space}) {
    const auto plan = plan_of(*scene, 3, split);
    ASSERT_TRUE(plan) << plan.error().message;
    const std::string text = planner::with_mergers(kScene, planner::mergers_block(*plan));
    const auto after = load_scene(dir.write("out.yaml", text));
    for (const SceneProblem& problem : after.problems) ADD_FAILURE() << to_string(problem);
    ASSERT_EQ(after.scene.mergers.size(), plan->mergers.size());
    for (std::size_t i = 0; i < plan->mergers.size(); ++i) {
      const MergerConfig &read = after.scene.mergers[i], &meant = plan->mergers[i].config;
      EXPECT_EQ(read.id, meant.id);
      EXPECT_EQ(read.inputs, meant.inputs);
      EXPECT_EQ(read.deadline_ms, meant.deadline_ms);
      ASSERT_EQ(read.region.has_value(), meant.region.has_value());
      if (!read.region) continue;
      EXPECT_LT(length(read.region->low - meant.region->low), 1e-6);
      EXPECT_LT(length(read.region->high - meant.region->high), 1e-6);
    }
    EXPECT_EQ(after.scene.fusion.chunk_m, 0.64);
    EXPECT_THAT(text, HasSubstr("# and this\nfusion:"));
    EXPECT_THAT(text, HasSubstr("# how it was\nmergers:"));
  }
}

TEST(SceneText, ABlockReplacesAnotherAndNothingElse) {
  const std::string block = "mergers:\n  - {id: r}\n";
  EXPECT_EQ(planner::with_mergers("a: 1\nmergers:\n- x\n- y\n\n# of b\nb: 2\n", block),
            "a: 1\n" + block + "\n# of b\nb: 2\n");
  EXPECT_EQ(planner::with_mergers("a: 1\nmergers: [x,\n  y]\nb: 2", block),
            "a: 1\n" + block + "b: 2\n");
  EXPECT_EQ(planner::with_mergers("a: 1", block), "a: 1\n" + block);
  EXPECT_EQ(planner::with_mergers("", block), block);
}

TEST(SceneText, IdsAreNeverTakenTwiceAndOddOnesAreQuoted) {
  auto sensors = ring("cam-", {0, 0, 1}, 3);
  sensors[0].id = "merger-1", sensors[1].id = "null", sensors[2].id = "7";
  const auto plan = plan_of(scene_of(sensors), 2, Split::sensors);
  ASSERT_TRUE(plan) << plan.error().message;
  std::set<std::string> ids;
  for (const PlannedMerger& merger : plan->mergers) ids.insert(merger.config.id);
  EXPECT_EQ(ids.size(), 3u);
  EXPECT_FALSE(ids.contains("merger-1"));
  EXPECT_THAT(planner::mergers_block(*plan), HasSubstr("\"null\""));
  EXPECT_THAT(planner::mergers_block(*plan), HasSubstr("\"7\""));
}

}  // namespace
}  // namespace mr
