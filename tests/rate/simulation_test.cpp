#include "mr/rate/simulation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "mr/rate/hull_targets.h"
#include "rate/made_stream.h"

namespace mr::rate {
namespace {

constexpr std::uint64_t kSeeds[] = {1, 2, 3};

/// Rates of which a scene could use each, and more.
std::vector<double> useful_targets(const MadeScene& scene) {
  return log_spaced(1.5 * made_least_mbps(scene), 0.7 * made_most_mbps(scene), 3);
}

/// One run of a scene; `settings`: those in force, of each capture.
struct RecordedRun {
  SimulationResult result;
  std::vector<Setting> settings;
};
RecordedRun run(const MadeScene& scene, const std::function<double(double)>& target_mbps,
                double seconds, std::uint64_t seed, const std::vector<Burst>& bursts = {}) {
  RecordedRun out;
  Controller controller(made_model(), scene.layers, scene.fps, target_mbps(0));
  const auto target = [&](double s) {
    out.settings.push_back(controller.setting());
    return target_mbps(s);
  };
  out.result = simulate(controller, made_sweep(scene), {"made", target}, bursts, seconds, seed);
  return out;
}

double share_used(const std::vector<SimulatedSecond>& seconds) {
  double sent = 0, target = 0;
  for (std::size_t i = 1; i < seconds.size(); ++i)
    sent += seconds[i].mbps, target += seconds[i].target_mbps;
  return sent / target;
}

double worst_second(const std::vector<SimulatedSecond>& seconds) {
  double worst = 0;
  for (std::size_t i = 1; i < seconds.size(); ++i)
    worst = std::max(worst, seconds[i].mbps / seconds[i].target_mbps);
  return worst;
}

/// The most reversals between finer and coarser in any ten seconds.
int most_reversals(const std::vector<Setting>& settings, double fps) {
  std::vector<double> at_s;
  int direction = 0;
  for (std::size_t i = 1; i < settings.size(); ++i) {
    const Setting &a = settings[i - 1], &b = settings[i];
    if (a == b) continue;
    const double finer = std::log(a.error_voxels / b.error_voxels) +
                         2 * std::log(b.scale / a.scale) + 0.115 * (a.qp - b.qp);
    const int now = finer > 0 ? 1 : -1;
    if (direction != 0 && now != direction) at_s.push_back(static_cast<double>(i) / fps);
    direction = now;
  }
  int most = 0;
  for (const double first : at_s)
    most = std::max<int>(most, static_cast<int>(std::ranges::count_if(
                                   at_s, [&](double s) { return s >= first && s < first + 10; })));
  return most;
}

TEST(Simulation, ASteadySceneGetsItsTargetAndNoMore) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double target : useful_targets(scene))
      for (const std::uint64_t seed : kSeeds) {
        const auto seconds = run(
                                 scene, [=](double) { return target; }, 30, seed)
                                 .result.seconds;
        EXPECT_NEAR(share_used(seconds), 1, 0.03) << scene.name << ' ' << target << ' ' << seed;
        EXPECT_LE(worst_second(seconds), 1.1) << scene.name << ' ' << target << ' ' << seed;
      }
}

TEST(Simulation, BurstsAndKeyFramesGetTheTargetAndNoMore) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double target : useful_targets(scene))
      for (const std::uint64_t seed : kSeeds) {
        const double second = target * 1e6 / 8;  // bytes
        const std::vector<Burst> bursts{{0, 3 * second, true, 1}, {12, second, true, 1.5}};
        const auto seconds = run(
                                 scene, [=](double) { return target; }, 30, seed, bursts)
                                 .result.seconds;
        EXPECT_NEAR(share_used(seconds), 1, 0.03) << scene.name << ' ' << target << ' ' << seed;
        EXPECT_LE(worst_second(seconds), 1.1) << scene.name << ' ' << target << ' ' << seed;
      }
}

TEST(Simulation, ASteadySceneDoesNotPump) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double target : useful_targets(scene))
      for (const std::uint64_t seed : kSeeds) {
        const RecordedRun got = run(
            scene, [=](double) { return target; }, 40, seed);
        const auto& seconds = got.result.seconds;
        for (std::size_t i = 3; i < seconds.size(); ++i)
          EXPECT_LE(std::abs(seconds[i].ssim - seconds[i - 1].ssim), 0.02)
              << scene.name << ' ' << target << ' ' << seed << " second " << i;
        EXPECT_LE(most_reversals(got.settings, scene.fps), 1) << scene.name << ' ' << target;
      }
}

TEST(Simulation, NoSecondIsOverTheTargetOfAnyTrace) {
  for (const MadeScene& scene : made_other_scenes())
    for (const std::uint64_t seed : kSeeds)
      for (const Trace& trace :
           traces(1.5 * made_least_mbps(scene), 0.8 * made_most_mbps(scene), seed)) {
        const auto seconds = run(scene, trace.mbps, 40, seed).result.seconds;
        EXPECT_LE(worst_second(seconds), 1.1) << scene.name << ' ' << trace.name << ' ' << seed;
      }
}

TEST(Simulation, AStepDownIsFollowedWithin300ms) {
  for (const MadeScene& scene : made_other_scenes())
    for (const double share : {0.2, 0.4, 0.65})
      for (const std::uint64_t seed : kSeeds) {
        const double high = 0.9 * made_most_mbps(scene);
        const auto steps = [=](double s) { return s < 6 || s >= 12 ? high : share * high; };
        EXPECT_LE(run(scene, steps, 15, seed).result.response_s, 0.3) << scene.name << ' ' << share;
      }
}

TEST(Simulation, BelowTheLeastTheStreamDoesNotStall) {
  for (const MadeScene& scene : made_other_scenes())
    for (const std::uint64_t seed : kSeeds) {
      const double target = 0.4 * made_least_mbps(scene);
      const auto seconds = run(
                               scene, [=](double) { return target; }, 20, seed)
                               .result.seconds;
      for (std::size_t i = 1; i + 1 < seconds.size(); ++i) {
        EXPECT_LT(seconds[i].skipped + seconds[i + 1].skipped, 60) << scene.name << ' ' << i;
        EXPECT_GT(seconds[i].skipped, 0) << scene.name << ' ' << i;
      }
    }
}

TEST(Simulation, IsTheSameForTheSameSeed) {
  const MadeScene scene;
  const auto wifi = traces(1, 6, 7)[3].mbps;
  const std::vector<Burst> bursts{{0, 1e6, true, 1}, {5, 2e5, true, 2}};
  const auto a = run(scene, wifi, 12, 5, bursts).result.seconds,
             b = run(scene, wifi, 12, 5, bursts).result.seconds,
             c = run(scene, wifi, 12, 6, bursts).result.seconds;
  ASSERT_EQ(a.size(), 12u);
  bool differs = false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].mbps, b[i].mbps);
    EXPECT_EQ(a[i].ssim, b[i].ssim);
    EXPECT_EQ(a[i].skipped, b[i].skipped);
    differs = differs || a[i].mbps != c[i].mbps;
  }
  EXPECT_TRUE(differs) << "seeds are noise";
}

TEST(Simulation, TheBacklogOfABurstIsSent) {
  const MadeScene scene;
  const std::vector<Burst> bursts{{0, 5e5, true, 1}, {10, 3e5, true, 1}};
  double bytes = 0;
  for (const SimulatedSecond& s : run(
                                      scene, [](double) { return 3.0; }, 20, 1, bursts)
                                      .result.seconds)
    bytes += s.refinement_mbps * 1e6 / 8;
  EXPECT_NEAR(bytes, 8e5, 1);
}

TEST(Traces, StayBetweenLowAndHighAndRepeatBySeed) {
  const auto a = traces(2, 20, 1), b = traces(2, 20, 1), c = traces(2, 20, 2);
  ASSERT_EQ(a.size(), c.size());
  for (std::size_t t = 0; t < a.size(); ++t) {
    bool differs = false;
    for (double s = 0; s < 600; s += 0.1) {
      EXPECT_GE(a[t].mbps(s), 2 * (1 - 1e-12)) << a[t].name;
      EXPECT_LE(a[t].mbps(s), 20 * (1 + 1e-12)) << a[t].name;
      EXPECT_EQ(a[t].mbps(s), b[t].mbps(s));
      differs = differs || a[t].mbps(s) != c[t].mbps(s);
    }
    EXPECT_EQ(differs, a[t].name == "wifi" || a[t].name == "cellular") << a[t].name;
  }
}

}  // namespace
}  // namespace mr::rate
