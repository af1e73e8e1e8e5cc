#include "mr/node/rungs.h"

#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <thread>

#include "mr/rate/models.h"
#include "support/merger_rig.h"

namespace mr {
namespace {

using namespace std::chrono_literals;
using node::Rungs;
using test::box_on_the_right;
using test::kLearnt;
using test::Merger;
using test::wall;

Scene scene_with_rungs() { return test::rate_controlled(test::two_sensors_with_layers(), 20); }

/// A root whose sensors see something that moves, and its rungs.
class RungsTest : public testing::Test {
 protected:
  void make(node::NodeClock clock, node::StillWork work = node::StillWork::at_once) {
    const std::shared_ptr<const rate::Model> model = *rate::open_model(root_.scene().rate, {});
    root_.node.control_rate(model);
    Rungs::Options options;
    options.model = model, options.clock = std::move(clock), options.still_work = work;
    rungs_.emplace(root_.scene(), root_.scene().mergers.front(), std::move(options));
  }
  RungsTest() { make({}); }
  void want(std::size_t rung, double mbps) {
    codec::Control control;
    control.target_mbps = mbps;
    rungs_->answer(rung, control, root_.now());
  }
  /// One tick; the rungs' packets.
  Rungs::Packets next() {
    const TimePoint now = root_.now();
    root_.see(box_on_the_right(0.02 * (tick_++ % 10)));
    std::vector<Rungs::Missing> missing;
    auto packets = rungs_->merge(root_.captures(), root_.node, took_, now, missing);
    for (const auto& [rung, why] : missing)
      EXPECT_EQ(why.cause, Error::Cause::over_budget) << why.message;
    return packets;
  }

  Merger root_{scene_with_rungs()};
  Duration took_{};  ///< the root, for each tick
  std::optional<Rungs> rungs_;
  int tick_ = 0;
};

TEST_F(RungsTest, ARungIsThereWhileItIsWanted) {
  EXPECT_EQ(rungs_->names(), (std::vector<std::string>{"root~1", "root~2"}));
  EXPECT_TRUE(next().empty());
  want(1, 2);
  auto packets = next();
  ASSERT_EQ(packets.size(), 1u);
  EXPECT_EQ(packets.front().first, 1u);
  test::PacketInbox inbox(root_.scene().lattice);
  const Packet first = inbox.take(packets.front().second);
  EXPECT_EQ(first.node, "root~2");
  EXPECT_EQ(first.sequence, 0u);
  for (int i = 0; i < 25; ++i) {
    packets = next();
    ASSERT_EQ(packets.size(), 1u) << "within its patience";
    inbox.take(packets.front().second);
  }
  for (int i = 0; i < 10; ++i)
    for (const auto& [rung, bytes] : next()) inbox.take(bytes);
  EXPECT_TRUE(next().empty()) << "nobody wants it any more";
  want(1, 2);
  packets = next();
  ASSERT_EQ(packets.size(), 1u);
  EXPECT_EQ(inbox.take(packets.front().second).epoch, first.epoch) << "it had a rest";
  for (int i = 0; i < 601; ++i) root_.pass();
  EXPECT_TRUE(next().empty());
  want(1, 2);
  packets = next();
  ASSERT_EQ(packets.size(), 1u);
  const auto again = codec::decode_packet(packets.front().second);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_NE(again->epoch, first.epoch) << "of another start, so that nobody joins the two";
}

TEST_F(RungsTest, ARungShowsTheSameSurface) {
  for (int i = 0; i < kLearnt; ++i) next();
  test::PacketInbox inbox(root_.scene().lattice);
  for (int i = 0; i < 15; ++i) {
    want(0, 4);
    for (const auto& [rung, bytes] : next()) inbox.take(bytes);
  }
  const auto shown = inbox.receiver().scene();
  ASSERT_TRUE(shown) << "chunks or pictures are missing";
  const double area = surface_area_m2(root_.surface());
  EXPECT_NEAR(surface_area_m2(test::all_of(shown->chunks)), area, 0.05 * area);
  EXPECT_EQ(shown->textures.size(), root_.decoded().textures.size()) << "with its plates";
}

TEST_F(RungsTest, ARungBeginsInTheBackgroundWhereStillWorkIsDoneThere) {
  make({}, node::StillWork::beside);
  for (int i = 0; i < kLearnt; ++i) next();
  want(0, 4);
  EXPECT_TRUE(next().empty()) << "it has only begun";
  const auto next_packet = [&] {
    Rungs::Packets packets;
    for (int i = 0; packets.empty() && i < 1000; ++i) {
      std::this_thread::sleep_for(10ms);
      want(0, 4);
      packets = next();
    }
    EXPECT_EQ(packets.size(), 1u);
    return packets.front().second;
  };
  test::PacketInbox inbox(root_.scene().lattice);
  EXPECT_EQ(inbox.take(next_packet()).sequence, 0u);
  EXPECT_EQ(inbox.take(next_packet()).sequence, 1u);
}

TEST_F(RungsTest, EachKeepsToItsRate) {
  for (int i = 0; i < kLearnt; ++i) next();
  constexpr double kTargets[] = {0.4, 0.2};  // Mbit/s
  double bits[2] = {};
  constexpr int kTicks = 60;
  for (int i = 0; i < kTicks; ++i) {
    want(0, kTargets[0]), want(1, kTargets[1]);
    for (const auto& [rung, bytes] : next()) bits[rung] += 8.0 * static_cast<double>(bytes.size());
  }
  for (std::size_t rung = 0; rung < 2; ++rung) {
    const double mbps = bits[rung] * 1e-6 * root_.scene().fps / kTicks;
    EXPECT_LT(mbps, 1.08 * kTargets[rung]);
    EXPECT_GT(mbps, 0.1 * kTargets[rung]);
  }
  EXPECT_GT(bits[0], bits[1]);
}

TEST_F(RungsTest, TogetherTheyTakeNoMoreTimeThanTheRoot) {
  constexpr int kTicks = 60;
  const TimePoint start(1h);
  TimePoint machine = start;
  make({.epoch = 1, .now = [&] { return machine += 10ms; }});  // each look at the clock
  took_ = 60ms;
  int packets[2] = {};
  for (int i = 0; i < kTicks; ++i) {
    want(0, 4), want(1, 2);
    for (const auto& [rung, bytes] : next()) ++packets[rung];
  }
  const Duration looks = 2 * kTicks * 10ms;  // whether there is time left
  EXPECT_LT(machine - start, 1.1 * kTicks * took_ + looks);
  EXPECT_GT(machine - start, 0.7 * kTicks * took_) << "but all that there is";
  EXPECT_GT(packets[0], 5);
  EXPECT_NEAR(packets[0], packets[1], 3) << "by turns";
}

TEST(RungNames, ThereAreNoneWhereTheRateIsFixedOrOneStreamIsWanted) {
  Scene scene = scene_with_rungs();
  scene.rate.rungs = 2;
  EXPECT_EQ(node::rung_names(scene), std::vector<std::string>{"root~1"});
  scene.rate.rungs = 1;
  EXPECT_TRUE(node::rung_names(scene).empty());
  scene.rate = {};
  EXPECT_TRUE(node::rung_names(scene).empty());
}

}  // namespace
}  // namespace mr
