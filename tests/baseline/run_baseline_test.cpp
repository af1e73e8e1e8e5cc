#include "mr/baseline/run_baseline.h"

#include <gtest/gtest.h>

#include <set>

#include "baseline/baseline_support.h"

namespace mr {
namespace {

using baseline::BaselineRun;
using test::value;

TEST(RunBaseline, ReportsLikeThePipeline) {
  for (const char* const pipeline : {"holoportation", "holoportation++", "points", "rgbd"}) {
    SCOPED_TRACE(pipeline);
    const Scene scene = test::small_scene(pipeline, 2);
    std::vector<int> shown;
    runtime::RunListener listener;
    listener.shown = [&](int frame, const DecodedScene& s) {
      EXPECT_FALSE(s.chunks.empty());
      shown.push_back(frame);
    };
    const BaselineRun run = value(baseline::run_baseline(scene, 2, 0, listener, test::rig_cache()));
    const runtime::RunReport& r = run.report;
    EXPECT_EQ(shown, (std::vector<int>{0, 1}));
    EXPECT_EQ(r.scene, "small-room");
    EXPECT_EQ(r.frames, 2);
    EXPECT_EQ(r.last_frame, 1);
    EXPECT_EQ(r.sensors, 2);
    EXPECT_EQ(r.triangles == 0, scene.pipeline == "points");
    EXPECT_GT(r.vertices, 1000u);
    EXPECT_GT(r.mesh_bytes_per_frame, 1000);
    EXPECT_EQ(r.texture_bytes_per_frame == 0, scene.pipeline == "points");
    EXPECT_EQ(r.end_to_end_ms.size(), 2u);
    EXPECT_GT(r.critical_path_ms, 0);
    EXPECT_LT(r.critical_path_ms, r.end_to_end_ms[0] + r.end_to_end_ms[1]);
    EXPECT_EQ(r.sensor_stages_ms.at("register").size(), 4u);
    EXPECT_FALSE(r.merge_stages_ms.empty());
    EXPECT_TRUE(r.drops.empty());
    EXPECT_EQ(run.last.textures.size(), scene.pipeline == "points" ? 0u : 2u);
    EXPECT_EQ(run.last.sources.size(), 2u);
  }
}

TEST(RunBaseline, EveryOtherCaptureCostsHalf) {
  Scene scene = test::small_scene("holoportation", 1);
  const BaselineRun all = value(baseline::run_baseline(scene, 4, 0, {}, test::rig_cache()));
  scene.coding.frame_divider = 2;
  std::set<std::int64_t> times;
  std::uint64_t bytes = 0;
  std::vector<int> shown;
  runtime::RunListener listener;
  listener.shown = [&](int frame, const DecodedScene& s) {
    shown.push_back(frame);
    times.insert(s.captured_at.time_since_epoch().count());
  };
  listener.sent = [&](int frame, std::uint64_t mesh, std::uint64_t texture) {
    EXPECT_EQ(mesh == 0, frame % 2 == 1);
    bytes += mesh + texture;
  };
  const BaselineRun half = value(baseline::run_baseline(scene, 4, 0, listener, test::rig_cache()));
  EXPECT_EQ(shown, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_EQ(times.size(), 2u);
  EXPECT_EQ(half.report.frames, 4);
  EXPECT_NEAR(half.report.mesh_bytes_per_frame, all.report.mesh_bytes_per_frame / 2,
              0.02 * all.report.mesh_bytes_per_frame);
  EXPECT_NEAR(static_cast<double>(bytes) / 4,
              half.report.mesh_bytes_per_frame + half.report.texture_bytes_per_frame, 1);
  EXPECT_EQ(half.report.end_to_end_ms.size(), 2u);
}

TEST(RunBaseline, StartsWhereItIsTold) {
  const Scene scene = test::small_scene("points", 1);
  const BaselineRun first = value(baseline::run_baseline(scene, 3, 0, {}, test::rig_cache()));
  const BaselineRun third = value(baseline::run_baseline(scene, 1, 2, {}, test::rig_cache()));
  EXPECT_EQ(first.last.captured_at, third.last.captured_at);
  EXPECT_EQ(first.last.chunks.front()->mesh, third.last.chunks.front()->mesh);
  EXPECT_EQ(third.report.last_frame, 0);
}

TEST(RunBaseline, WhatNeverShowsAnythingIsAnError) {
  Scene scene = test::small_scene("holoportation", 1);
  scene.volume = Box3d{{100, 100, 100}, {101, 101, 101}};
  std::vector<std::string> dropped;
  runtime::RunListener listener;
  listener.dropped = [&](const std::string& message) { dropped.push_back(message); };
  const auto run = baseline::run_baseline(scene, 2, 0, listener, test::rig_cache());
  ASSERT_FALSE(run);
  EXPECT_EQ(run.error().cause, Error::Cause::empty);
  ASSERT_EQ(dropped.size(), 2u);
  EXPECT_NE(dropped[0].find("Holoportation: "), std::string::npos);
}

}  // namespace
}  // namespace mr
