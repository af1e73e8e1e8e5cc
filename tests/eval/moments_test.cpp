#include "mr/eval/moments.h"
#include "mr/sensor/rgbd_images.h"

#include <gtest/gtest.h>

namespace mr::eval {
namespace {

Scene rig_of(int frames, bool loop) {
  Scene scene;
  scene.rig.emplace();
  scene.rig->frames = frames, scene.rig->loop = loop;
  scene.still.layers = false;
  return scene;
}

Scene stills(int pictures, bool loop) {
  Scene scene;
  sensor::RgbdImagesSource source;
  source.depth.resize(pictures);
  source.loop = loop;
  scene.sensors.emplace_back().source = source;
  return scene;
}

TEST(Moments, AreSpreadOverWhatTheSourcesHold) {
  const Moments looped = spread_moments(rig_of(300, true), 3, 4);
  EXPECT_EQ(looped.first, (std::vector<int>{0, 100, 200}));
  EXPECT_EQ(looped.shown(1), 103);
  const Moments once = spread_moments(rig_of(303, false), 3, 4);
  EXPECT_EQ(once.first, (std::vector<int>{0, 100, 200}));
  for (std::size_t m = 0; m < once.first.size(); ++m) EXPECT_LT(once.shown(m), 303);
}

TEST(Moments, AStillIsOneMomentAndAShortRecordingAShortBurst) {
  EXPECT_EQ(spread_moments(stills(1, true), 3, 4).first, std::vector<int>{0});
  EXPECT_EQ(spread_moments(stills(1, true), 3, 4).burst, 4);
  const Moments brief = spread_moments(stills(2, false), 3, 4);
  EXPECT_EQ(brief.burst, 2);
  EXPECT_EQ(brief.first, std::vector<int>{0});
}

TEST(Moments, APipelineWithMemoryIsWarmedUpByWhatComesBefore) {
  const Moments looped = spread_moments(rig_of(300, true), 3, 4);
  EXPECT_EQ(looped.later(), 300);
  EXPECT_EQ(looped.fed_from(), 200);  // the same captures again: 200 .. 299, and 300 shows 0
  const Moments brief = spread_moments(rig_of(30, true), 3, 4);
  EXPECT_EQ(brief.first, (std::vector<int>{0, 10, 20}));
  EXPECT_EQ(brief.later(), 120);
  EXPECT_EQ(brief.fed_from(), 20);
}

TEST(Moments, OfARecordingWithLayersLieAfterTheWarmUp) {
  Scene scene = rig_of(303, false);
  scene.still.layers = true;
  const Moments once = spread_moments(scene, 2, 4);
  EXPECT_EQ(once.first, (std::vector<int>{100, 200}));
  EXPECT_EQ(once.later(), 0);
  EXPECT_EQ(once.fed_from(), 0);
  scene.rig->frames = 41;
  const Moments brief = spread_moments(scene, 3, 4);
  EXPECT_EQ(brief.first.front(), 18);
  EXPECT_EQ(brief.fed_from(), 0);
  for (std::size_t m = 0; m < brief.first.size(); ++m) EXPECT_LT(brief.shown(m), 41);
  EXPECT_TRUE(is_stateful(scene));
  scene.pipeline = "points";
  EXPECT_FALSE(is_stateful(scene));
}

TEST(Rate, OfASteadyStreamHasNoKeyFrame) {
  Rate rate;
  rate.add_steady({1000, 0, 2000});
  EXPECT_NEAR(rate.mbps(30), 30 * 1000 * 8e-6, 1e-12);
}

TEST(Rate, IsOfOneKeyFrameASecond) {
  Rate rate;
  rate.add_burst({100'000, 10'000, 20'000});  // 100 kB and 29 times 15 kB
  EXPECT_NEAR(rate.mbps(30), (100'000 + 29 * 15'000) * 8e-6, 1e-9);
  rate.add_burst({0, 0, 0});
  EXPECT_NEAR(rate.mbps(30), (100'000 + 29 * 15'000) * 4e-6, 1e-9);
}

TEST(Rate, OfCapturesForThemselvesIsTheirMean) {
  Rate rate;
  rate.add_burst({1000});
  rate.add_burst({3000});
  EXPECT_NEAR(rate.mbps(30), 30 * 2000 * 8e-6, 1e-12);
  EXPECT_EQ(Rate().mbps(30), 0);
}

}  // namespace
}  // namespace mr::eval
