#include "mr/node/rate_control.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <vector>

#include "mr/node/merge_task.h"
#include "mr/node/plans.h"
#include "mr/rate/models.h"
#include "support/merger_rig.h"

namespace mr {
namespace {

using namespace std::chrono_literals;
using node::CaptureSet;
using node::RateControl;

constexpr double kTarget = 4;  // Mbit/s

/// The captures of ticks that are so far apart, and whose nodes take so long.
class Ticks {
 public:
  explicit Ticks(Duration apart, Duration coding = 5ms) : apart_(apart), coding_(coding) {}

  CaptureSet next() {
    CaptureSet out;
    out.tick = TimePoint(1h) + apart_ * n_++;
    out.marks["sensors/reconstructed"] = out.tick;
    out.marks["sensors/coded"] = out.tick + coding_;
    return out;
  }

 private:
  Duration apart_, coding_;
  int n_ = 0;
};

constexpr double kWaiting = 1e9;  // bytes of still surface

/// A capture whose moving surface takes so much, and as much still surface as may come. Its bytes.
double capture(RateControl& control, const CaptureSet& captures, double moving_bytes = 1000) {
  CodingPlan plan;
  if (!control.begin(captures, {.still_bytes = kWaiting}, false, plan)) return 0;
  const RateControl::Budget budget = control.code(moving_bytes, kWaiting, false);
  Packet packet;
  EncodedChunk moving, still;
  moving.payload = std::vector<std::byte>(static_cast<std::size_t>(moving_bytes));
  still.key.id.layer = Layer::still;
  still.payload = std::vector<std::byte>(static_cast<std::size_t>(budget.refinement.bytes));
  packet.chunks = {moving, still};
  const std::size_t bytes = moving.payload.size() + still.payload.size() + 100;
  control.sent(packet, bytes);
  control.note_time(captures, 10ms);
  return static_cast<double>(bytes);
}

class RateControlTest : public testing::Test {
 protected:
  double error_m(RateControl& control, SensorId sensor) const {
    const auto plan = control.take_plan();
    return plan ? plan->of(sensor).decimation.error_m : -1;
  }
  Scene scene_ = test::rate_controlled(test::two_sensors_with_layers(), kTarget);
};

TEST_F(RateControlTest, WhereThereAreFewerTicksEachMayTakeMore) {
  for (const Duration apart : {100ms, 300ms}) {
    RateControl control(scene_, *rate::open_model(scene_.rate, {}));
    Ticks ticks(apart);
    const int all = static_cast<int>(20s / apart);
    double bits = 0;
    for (int i = 0; i < all; ++i) {
      const double bytes = capture(control, ticks.next());
      if (i >= all / 2) bits += 8 * bytes;
    }
    EXPECT_NEAR(bits * 1e-6 / 10, kTarget, 0.05 * kTarget);
  }
}

TEST_F(RateControlTest, ASlowSensorMeansFewerTrianglesButPeopleKeepTheirLimbs) {
  RateControl control(scene_, *rate::open_model(scene_.rate, {}));
  Ticks quick(100ms);
  for (int i = 0; i < 40; ++i) capture(control, quick.next());
  const double before_m = error_m(control, SensorId{0});
  EXPECT_GT(before_m, 0);
  // A sensor that is quicker the fewer triangles it has.
  double error = before_m;
  for (int i = 0; i < 200; ++i) {
    Ticks slow(100ms, std::chrono::milliseconds(static_cast<int>(100 + 2 / error)));
    CaptureSet captures = slow.next();
    captures.tick += 100ms * (40 + i);
    capture(control, captures);
    if (const double now = error_m(control, SensorId{0}); now > 0) error = now;
  }
  EXPECT_GT(error, before_m);
  EXPECT_LE(error, std::max(0.02, scene_.voxel_m) + 1e-9);
}

TEST_F(RateControlTest, ASensorOfWhoseSurfaceLittleIsShownIsCoarser) {
  RateControl control(scene_, *rate::open_model(scene_.rate, {}));
  Ticks ticks(100ms);
  const auto runs = [](std::uint32_t of_first, std::uint32_t of_second) {
    return std::vector<SensorRun>{{0, of_first, SensorId{0}}, {of_first, of_second, SensorId{1}}};
  };
  Chunk chunk;
  chunk.key.id.layer = Layer::moving;
  chunk.mesh.sensors = runs(500, 500);
  Mesh shown;  // the second sensor's share of it is a tenth of the first's
  shown.views = {{0, 450, view_of(SensorId{0})}, {450, 45, view_of(SensorId{1})}};
  for (int i = 0; i < 150; ++i) {
    CaptureSet captures = ticks.next();
    for (const std::uint32_t n : {0u, 1u}) {
      SourceInfo source;
      source.sensor = SensorId{n};
      captures.sources.push_back(source);
      View view;
      view.id = view_of(SensorId{n});
      captures.views.push_back(view);
    }
    DecodedScene scene;
    scene.chunks = {std::make_shared<const Chunk>(chunk)};
    captures.scenes = {scene};
    capture(control, captures);
    control.note_surface(captures, shown);
  }
  const auto plan = control.take_plan();
  ASSERT_TRUE(plan);
  const double first_m = plan->of(SensorId{0}).decimation.error_m,
               second_m = plan->of(SensorId{1}).decimation.error_m;
  EXPECT_GT(second_m, 1.2 * first_m);
  EXPECT_LE(second_m, 0.04 + 1e-9);
}

/// The plan that a merger passes on to an input, of all that it asks for.
std::optional<ScenePlan> passed(const std::vector<node::Ask>& asks, std::size_t input) {
  std::optional<ScenePlan> out;
  for (const node::Ask& ask : asks)
    if (ask.input == input && ask.request.plan) out = ask.request.plan;
  return out;
}

TEST(MergeTask, WhatComesOverANarrowLinkIsPlannedMoreCoarsely) {
  test::Merger sensors(test::two_sensors());
  Scene scene = sensors.scene();
  scene.links = {{"cam-1", "root", 0.02}};
  node::MergeTask task(scene, scene.mergers.front(), {}, {});
  codec::Control control;
  control.plan = node::scene_plan(scene, 0.5);
  TimePoint now = sensors.now();
  task.answer(control, now);
  std::optional<ScenePlan> first, last;
  for (int i = 0; i < 60; ++i, now += 100ms) {
    node::Arrivals arrivals;
    for (const std::uint32_t n : {0u, 1u})
      arrivals.packets.push_back({n, net::as_message(sensors.sense(test::frame_of(
                                         scene, SensorId{n}, static_cast<std::uint64_t>(i),
                                         test::box_on_the_right(0.02 * (i % 10)))))});
    const auto plan = passed(task.step(arrivals, now), 0);
    if (!first) first = plan;
    if (plan) last = plan;
  }
  ASSERT_TRUE(first && last);
  EXPECT_EQ(first->of(SensorId{0}), first->of(SensorId{1}));
  EXPECT_EQ(last->of(SensorId{0}), first->of(SensorId{0})) << "its link has no limit";
  EXPECT_GT(last->of(SensorId{1}).texture_qp, first->of(SensorId{1}).texture_qp);
  EXPECT_GT(last->of(SensorId{1}).decimation.error_m, first->of(SensorId{1}).decimation.error_m);
}

}  // namespace
}  // namespace mr
