// Measuring again from one learnt state (LockstepScene::learn, read, memory, recall), and plans
// that name layers and sensors, in lockstep.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/node/plans.h"
#include "mr/runtime/lockstep_scene.h"
#include "support/layers.h"

namespace mr {
namespace {

using runtime::CaptureCost;
using runtime::LockstepScene;

/// A room with a walking person; the layers are apart.
Scene walked_through() {
  RigConfig rig = test::small_rig(300);
  rig.people = 1;
  return test::with_layers(test::rig_scene(rig));
}

class Replay : public testing::Test {
 protected:
  explicit Replay(Scene scene = walked_through()) : pipeline_(open(std::move(scene))) {}

  static std::unique_ptr<LockstepScene> open(Scene scene) {
    auto opened = LockstepScene::open(std::move(scene));
    EXPECT_TRUE(opened) << opened.error().message;
    return *std::move(opened);
  }
  /// The costs of captures of the sources, or of these.
  std::vector<CaptureCost> costs(int count) {
    return run([&](auto& listener) { return pipeline_->run(count, listener); });
  }
  std::vector<CaptureCost> costs(const std::vector<LockstepScene::Capture>& captures) {
    return run([&](auto& listener) { return pipeline_->run(captures, listener); });
  }
  std::vector<CaptureCost> run(const auto& captures) {
    std::vector<CaptureCost> out;
    runtime::RunListener listener;
    listener.captured = [&](int, const CaptureCost& cost) { out.push_back(cost); };
    listener.dropped = [](const std::string& message) { ADD_FAILURE() << message; };
    Arena(2).run([&] {
      const auto ran = captures(listener);
      ASSERT_TRUE(ran) << ran.error().message;
    });
    return out;
  }
  ScenePlan plan() const {
    const Scene& scene = pipeline_->scene();
    return {node::sensor_plan(scene, SensorId{0}), node::merger_plan(scene, true)};
  }
  std::size_t triangles(Layer layer) const {
    std::size_t out = 0;
    for (const auto& chunk : pipeline_->decoded()->chunks)
      if (chunk->key.id.layer == layer) out += chunk->mesh.triangles.size();
    return out;
  }
  std::vector<ChunkKey> still() const {
    std::vector<ChunkKey> out;
    for (const auto& chunk : pipeline_->decoded()->chunks)
      if (chunk->key.id.layer == Layer::still) out.push_back(chunk->key);
    return out;
  }

  std::unique_ptr<LockstepScene> pipeline_;
};

TEST_F(Replay, WhatWasOnlyLearntIsHandedOverSooner) {
  constexpr int kHandOver = 14;
  costs(kHandOver);
  EXPECT_EQ(triangles(Layer::still), 0u) << "still to be learnt";
  pipeline_ = open(walked_through());
  ASSERT_TRUE(pipeline_->learn(60));
  EXPECT_FALSE(pipeline_->decoded()) << "nothing is reconstructed from learning";
  costs(kHandOver);
  EXPECT_GT(triangles(Layer::still), 1000u);
}

TEST_F(Replay, ARepeatedBurstCostsWhatItDid) {
  ASSERT_TRUE(pipeline_->learn(60));
  costs(20);
  const auto memory = pipeline_->memory();
  const auto burst = *pipeline_->read(4);
  const auto once = costs(burst);
  const std::size_t moving = triangles(Layer::moving);
  ASSERT_GT(moving, 50u);
  costs(10);  // other captures in between
  pipeline_->recall(memory);
  const auto again = costs(burst);
  EXPECT_NEAR(static_cast<double>(triangles(Layer::moving)), static_cast<double>(moving),
              0.03 * static_cast<double>(moving));
  for (std::size_t i = 0; i < burst.size(); ++i)
    EXPECT_NEAR(static_cast<double>(again[i].mesh_bytes - again[i].still_bytes),
                static_cast<double>(once[i].mesh_bytes - once[i].still_bytes),
                0.1 * static_cast<double>(once[i].mesh_bytes - once[i].still_bytes));
}

TEST_F(Replay, AnotherPipelineGoesOnFromTheLearntState) {
  ASSERT_TRUE(pipeline_->learn(60));
  costs(20);
  const auto memory = pipeline_->memory();
  const auto burst = *pipeline_->read(4);
  costs(burst);
  const auto expected = static_cast<double>(triangles(Layer::still));
  pipeline_ = open(walked_through());
  for (int i = 0; i < 6; ++i) {
    pipeline_->recall(memory);
    costs(burst);
  }
  EXPECT_NEAR(static_cast<double>(triangles(Layer::still)), expected, 0.05 * expected);
}

TEST_F(Replay, APlanOfOneSensorReachesThatSensorAlone) {
  RigConfig rig = test::noisy(test::small_rig(20), 0.1);
  pipeline_ = open(test::rig_scene(rig));
  costs(2);
  const auto all = [&] { return static_cast<double>(triangles(Layer::moving)); };
  const double before = all();
  ScenePlan wanted = plan();
  wanted.by_sensor[SensorId{1}] = wanted.sensors;
  wanted.by_sensor[SensorId{1}].decimation.ratio /= 8;
  ASSERT_TRUE(pipeline_->set_plan(wanted));
  costs(3);
  EXPECT_LT(all(), 0.85 * before);
  EXPECT_GT(all(), 0.3 * before) << "the other sensor goes on as it was";
}

TEST_F(Replay, PlatesAreEncodedAgainWhenTheirPlanIsFinerAndWithoutAKeyFrame) {
  pipeline_ = open(test::with_layers(test::rig_scene(test::small_rig(300))));
  costs(60);
  const auto plates = [](const std::vector<CaptureCost>& of) {
    std::uint64_t sum = 0;
    for (const CaptureCost& cost : of) sum += cost.plate_bytes;
    return sum;
  };
  ASSERT_EQ(plates(costs(5)), 0u) << "nothing changes in a still room";
  ScenePlan wanted = plan();
  wanted.root.plate_qp += 10;
  ASSERT_TRUE(pipeline_->set_plan(wanted));
  EXPECT_EQ(plates(costs(5)), 0u) << "what is there is no coarser";
  wanted.root.plate_qp -= 18;
  ASSERT_TRUE(pipeline_->set_plan(wanted));
  const auto finer = costs(5);
  EXPECT_GT(plates(finer), 0u);
  for (const CaptureCost& cost : finer) EXPECT_FALSE(cost.key_frame);
  EXPECT_EQ(plates(costs(5)), 0u) << "once";
}

TEST_F(Replay, TheRootsDecimationLeavesTheStillSurfaceAlone) {
  ASSERT_TRUE(pipeline_->learn(60));
  costs(40);
  const auto before = still();
  const std::size_t moving = triangles(Layer::moving);
  const auto memory = pipeline_->memory();
  const auto burst = *pipeline_->read(2);
  ScenePlan wanted = plan();
  wanted.root.decimation = {0, 0.2};
  ASSERT_TRUE(pipeline_->set_plan(wanted));
  pipeline_->recall(memory);
  costs(burst);
  EXPECT_LT(triangles(Layer::moving), moving);
  std::size_t kept = 0;
  for (const ChunkKey& key : still()) kept += std::ranges::count(before, key);
  EXPECT_GT(kept, before.size() * 8 / 10) << "what a burst changes is little";
}

}  // namespace
}  // namespace mr
