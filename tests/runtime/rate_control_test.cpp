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

constexpr int kWidth = 480;  // of pictures that take a good part of the rate

/// Somebody walks through a room.
Scene controlled(double target_mbps, bool layers = true, int color_width = 160) {
  RigConfig rig = test::small_rig(600);
  rig.people = 1;
  rig.color_width = color_width, rig.color_height = color_width * 9 / 16;
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

TEST(RateControl, AStartIsPacedAndShowsAllOfTheStillSurface) {
  constexpr int kCaptures = 150;
  Stream open(controlled(1000, true, kWidth));
  open.run(kCaptures);
  const double all = static_cast<double>(open.still_chunks());
  ASSERT_GT(all, 0);
  EXPECT_EQ(open.costs.back().plan.texture_qp, 18);

  constexpr double kTarget = 1;  // Mbit/s; at its finest the first second takes much more
  EXPECT_GT(open.mbps(0, open.fps), 2.5 * kTarget);
  Stream stream(controlled(kTarget, true, kWidth));
  stream.run(kCaptures);
  EXPECT_LE(stream.worst_second(0), 1.1 * kTarget);
  EXPECT_NEAR(static_cast<double>(stream.still_chunks()) / all, 1, 0.05) << "held back, then shown";
  std::vector<int> plates;
  for (const CaptureCost& cost : stream.costs)
    if (cost.plate_bytes > 0) plates.push_back(cost.plan.plate_qp);
  ASSERT_FALSE(plates.empty());
  EXPECT_GT(std::ranges::max(plates), 20) << "coarse ones first";
  EXPECT_EQ(plates.back(), 20) << testing::PrintToString(plates);
}

TEST(RateControl, KeepsToTheTargetWhileSomebodyWalks) {
  Stream open(controlled(1000, true, kWidth));
  open.run(170);
  const double target = 0.5 * open.mbps(120, 170);  // of what the best quality takes
  Stream stream(controlled(1000, true, kWidth));
  stream.run(110);
  stream.pipeline->set_target(target);
  stream.run(60);
  EXPECT_NEAR(stream.mbps(120, 170) / target, 1, 0.1);
  EXPECT_LE(stream.worst_second(115), 1.1 * target);
  EXPECT_GT(stream.costs.at(120).plan.texture_qp, open.costs.at(120).plan.texture_qp);
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
