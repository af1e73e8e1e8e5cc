// The plan in force, from the root to the sensors (docs/wire-format.md, Control), in lockstep.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/node/plans.h"
#include "mr/runtime/lockstep_scene.h"
#include "support/rig_scene.h"

namespace mr {
namespace {

/// What of a capture a plan changes.
struct Sent {
  double triangles = 0, texture_bytes = 0;
  bool key_frame = false;
};

/// Runs some captures of a scene and remembers them.
class Lockstep {
 public:
  explicit Lockstep(const Scene& scene) : pipeline_(*runtime::LockstepScene::open(scene)) {
    listener_.captured = [this](int, const runtime::CaptureCost& cost) {
      const auto triangles = static_cast<double>(pipeline_->surface()->triangles.size());
      sent_.push_back({triangles, static_cast<double>(cost.texture_bytes), cost.key_frame});
    };
    listener_.dropped = [](const std::string& message) { ADD_FAILURE() << message; };
  }

  /// The captures that this adds.
  std::vector<Sent> captures(int count) {
    sent_.clear();
    Arena(2).run([&] { EXPECT_TRUE(pipeline_->run(count, listener_)); });
    return sent_;
  }
  runtime::LockstepScene& scene() { return *pipeline_; }

 private:
  std::unique_ptr<runtime::LockstepScene> pipeline_;
  runtime::RunListener listener_;
  std::vector<Sent> sent_;
};

ScenePlan initial_plan(const Scene& scene) {
  return {node::sensor_plan(scene, SensorId{0}), node::merger_plan(scene, true)};
}

/// Everything moves a little, so that every capture is coded anew.
Scene lively_scene() { return test::rig_scene(test::noisy(test::small_rig(20), 0.1)); }

TEST(Plans, ANewQualityTakesEffectAtOnceAndWithoutAKeyFrame) {
  Lockstep run(lively_scene());
  ASSERT_TRUE(run.captures(3)[0].key_frame) << "the first capture";
  const double before = run.captures(2)[1].texture_bytes;
  ScenePlan plan = initial_plan(run.scene().scene());
  plan.root.texture_qp += 12;
  ASSERT_TRUE(run.scene().set_plan(plan));
  const std::vector<Sent> coarse = run.captures(3);
  plan.root.texture_qp -= 18;
  ASSERT_TRUE(run.scene().set_plan(plan));
  const std::vector<Sent> fine = run.captures(3);
  for (const auto& captures : {coarse, fine})
    for (const Sent& sent : captures) EXPECT_FALSE(sent.key_frame);
  EXPECT_LT(coarse[0].texture_bytes, 0.5 * before) << "already in the next capture";
  EXPECT_GT(fine[0].texture_bytes, 2 * before);
}

TEST(Plans, AnImpossiblePlanIsRefused) {
  Lockstep run(lively_scene());
  const auto refused = [&](auto edit) {
    ScenePlan plan = initial_plan(run.scene().scene());
    edit(plan);
    return !run.scene().set_plan(plan);
  };
  EXPECT_FALSE(refused([](ScenePlan&) {}));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.sensors.decimation.ratio = -1; }));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.root.decimation = {0, 0}; }));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.root.texture_scale = 1e-4; }));
  EXPECT_TRUE(refused([](ScenePlan& p) { p.root.still_error_m = std::nan(""); }));
}

TEST(Plans, APlanGivenToTheRootReachesTheSensors) {
  Lockstep run(lively_scene());
  const double before = run.captures(2)[1].triangles;
  ScenePlan plan = initial_plan(run.scene().scene());
  plan.sensors.decimation.ratio /= 4;
  ASSERT_TRUE(run.scene().set_plan(plan));
  const std::vector<Sent> after = run.captures(3);
  EXPECT_GT(after[0].triangles, 0.7 * before) << "the root hands it on with this capture";
  EXPECT_LT(after[1].triangles, 0.4 * before);
  EXPECT_LT(after[2].triangles, 0.4 * before);
  for (const Sent& sent : after) EXPECT_FALSE(sent.key_frame);
}

}  // namespace
}  // namespace mr
