// A scene whose rate is controlled, in lockstep: what the root sends, second by second.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <set>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/runtime/lockstep_scene.h"
#include "support/layers.h"

namespace mr {
namespace {

using runtime::CaptureCost;
using runtime::LockstepScene;

/// Somebody walks through a room.
Scene controlled(double target_mbps, bool layers = true) {
  RigConfig rig = test::small_rig(600);
  rig.people = 1;
  Scene scene = test::rig_scene(rig);
  scene.still.layers = layers;
  scene.rate = {RateConfig::Model::ours, target_mbps, {}};
  return scene;
}

struct Stream {
  explicit Stream(const Scene& scene) : fps(static_cast<std::size_t>(scene.fps)) {
    auto opened = LockstepScene::open(scene);
    EXPECT_TRUE(opened) << opened.error().message;
    pipeline = *std::move(opened);
  }

  /// A capture that is left out gives no surface: no error here.
  void run(int captures) {
    runtime::RunListener listener;
    listener.captured = [&](int, const CaptureCost& cost) { costs.push_back(cost); };
    listener.packet = [&](int, std::span<const std::byte> bytes) {
      packets.emplace_back(bytes.begin(), bytes.end());
    };
    listener.warned = [&](const std::string& line) { told.push_back(line); };
    Arena(2).run([&] {
      for (int i = 0; i < captures; ++i) {
        const auto ran = pipeline->run(1, listener);
        EXPECT_TRUE(ran || ran.error().cause == Error::Cause::empty);
      }
    });
  }
  static double bytes_of(const CaptureCost& cost) {
    return static_cast<double>(cost.mesh_bytes + cost.texture_bytes + cost.head_bytes);
  }
  double mbps(std::size_t from, std::size_t to) const {
    double sum = 0;
    for (std::size_t i = from; i < to; ++i) sum += bytes_of(costs.at(i));
    return sum * 8e-6 * static_cast<double>(fps) / static_cast<double>(to - from);
  }
  /// The highest rate of a second that begins at `from` or later.
  double worst_second(std::size_t from) const {
    double out = 0;
    for (std::size_t i = from; i + fps <= costs.size(); ++i) out = std::max(out, mbps(i, i + fps));
    return out;
  }
  std::size_t still_chunks() const {
    return static_cast<std::size_t>(std::ranges::count_if(
        pipeline->decoded()->chunks,
        [](const auto& chunk) { return chunk->key.id.layer == Layer::still; }));
  }

  std::size_t fps;
  std::unique_ptr<LockstepScene> pipeline;
  std::vector<CaptureCost> costs;
  std::vector<std::vector<std::byte>> packets;
  std::vector<std::string> told;
};

TEST(RateControl, KeepsToTheTargetAndShowsAllOfTheStillSurface) {
  Stream open(controlled(1000));
  open.run(120);
  const std::size_t all = open.still_chunks();
  ASSERT_GT(all, 0u);
  const double most = open.mbps(90, 120);  // somebody walks, at the best quality
  EXPECT_EQ(open.costs.back().plan.texture_qp, 18);

  const double target = 0.4 * most;
  Stream stream(controlled(target));
  stream.run(120);
  EXPECT_LE(stream.worst_second(0), 1.1 * target);
  EXPECT_EQ(stream.still_chunks(), all) << "held back, and then shown";
  EXPECT_GT(stream.costs.back().plan.texture_qp, 18);
  std::set<int> plates;
  for (const CaptureCost& cost : stream.costs)
    if (cost.plate_bytes > 0) plates.insert(cost.plan.plate_qp);
  ASSERT_FALSE(plates.empty());
  EXPECT_LT(*plates.begin(), *plates.rbegin()) << "coarse ones first";
}

TEST(RateControl, FollowsAViewersTarget) {
  const double most = [] {
    Stream open(controlled(1000, false));
    open.run(20);
    return open.mbps(10, 20);
  }();
  Stream stream(controlled(most, false));
  stream.run(30);
  const double before = stream.mbps(15, 30);
  stream.pipeline->set_target(0.4 * most);
  stream.run(30);
  EXPECT_NEAR(stream.mbps(40, 60) / (0.4 * most), 1, 0.06);
  stream.pipeline->set_target(1e4);
  stream.run(30);
  EXPECT_LT(stream.mbps(75, 90), 1.1 * most) << "no more than the scene's own target";
  EXPECT_GT(stream.mbps(75, 90), 0.8 * before);
}

TEST(RateControl, BelowTheLeastCapturesAreLeftOut) {
  Stream stream(controlled(0.02, false));
  stream.run(60);
  const auto shown = std::ranges::count_if(stream.costs, &CaptureCost::shown);
  EXPECT_LT(shown, 15);
  EXPECT_GT(shown, 2);
  EXPECT_EQ(stream.costs.back().plan.texture_qp == 51 || !stream.costs.back().shown, true);
}

TEST(RateControl, SameInputSameBytesOnAnyNumberOfThreads) {
  std::vector<std::vector<std::byte>> first;
  for (const int threads : {1, 2}) {
    Stream stream(controlled(0.5));
    Arena(threads).run([&] {
      runtime::RunListener listener;
      listener.packet = [&](int, std::span<const std::byte> bytes) {
        stream.packets.emplace_back(bytes.begin(), bytes.end());
      };
      for (int i = 0; i < 40; ++i) static_cast<void>(stream.pipeline->run(1, listener).ok());
    });
    EXPECT_FALSE(stream.packets.empty());
    if (first.empty())
      first = stream.packets;
    else
      EXPECT_EQ(first, stream.packets);
  }
}

TEST(RateControl, AModelFileThatCannotBeUsedIsToldAndReplaced) {
  const auto file = std::filesystem::path(testing::TempDir()) / "models_of_another_version.json";
  std::ofstream(file) << R"({"version": 999})";
  for (const auto& path : {file, std::filesystem::path("/nowhere/models.json")}) {
    Scene scene = controlled(2, false);
    scene.rate.model_file = path;
    Stream stream(scene);
    stream.run(3);
    ASSERT_EQ(stream.told.size(), 1u) << path;
    EXPECT_NE(stream.told[0].find(path.string()), std::string::npos) << stream.told[0];
    EXPECT_NE(stream.told[0].find("takes its place"), std::string::npos) << stream.told[0];
    EXPECT_TRUE(stream.costs.front().shown);
  }
}

}  // namespace
}  // namespace mr
