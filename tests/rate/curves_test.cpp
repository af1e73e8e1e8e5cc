#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "mr/rate/cholesky.h"
#include "mr/rate/hull_targets.h"
#include "mr/rate/monotone_curve.h"
#include "mr/rate/rate_distortion.h"
#include "mr/rate/swept_surface.h"
#include "rate/made_sweeps.h"

namespace mr::rate {
namespace {

double uniform(std::mt19937& random) { return static_cast<double>(random() >> 8) * 0x1p-24; }

/// Ascending, by unequal steps; `rises`: values that rise or stay, else any.
std::vector<double> random_numbers(std::mt19937& random, std::size_t count, bool rises) {
  std::vector<double> out;
  for (std::size_t i = 0; i < count; ++i) {
    const double step = rises && random() % 4 == 0 ? 0 : 0.05 + uniform(random);
    out.push_back(rises ? (out.empty() ? 0 : out.back()) + step : 4 * uniform(random));
  }
  return out;
}

std::vector<double> random_axis(std::mt19937& random, std::size_t count) {
  std::vector<double> out;
  for (std::size_t i = 0; i < count; ++i)
    out.push_back((out.empty() ? -3 : out.back()) + 0.05 + 2 * uniform(random));
  return out;
}

TEST(MonotoneCurve, PassesThroughItsPoints) {
  std::mt19937 random(1);
  for (int round = 0; round < 50; ++round) {
    const std::size_t count = 1 + random() % 8;
    const auto x = random_axis(random, count), y = random_numbers(random, count, false);
    const MonotoneCurve curve(x, y);
    for (std::size_t i = 0; i < count; ++i) EXPECT_NEAR(curve.at(x[i]), y[i], 1e-12);
  }
}

TEST(MonotoneCurve, RisesWhereItsPointsRise) {
  std::mt19937 random(2);
  for (int round = 0; round < 50; ++round) {
    const auto x = random_axis(random, 6), y = random_numbers(random, 6, true);
    const MonotoneCurve curve(x, y);
    double before = curve.at(x.front() - 1);
    for (double at = x.front() - 1; at <= x.back() + 1; at += 0.01) {
      EXPECT_GE(curve.at(at), before - 1e-12) << "round " << round << " at " << at;
      before = curve.at(at);
    }
  }
}

TEST(MonotoneCurve, StaysBetweenNeighbouringPoints) {
  std::mt19937 random(3);
  for (int round = 0; round < 50; ++round) {
    const auto x = random_axis(random, 6), y = random_numbers(random, 6, false);
    const MonotoneCurve curve(x, y);
    for (std::size_t i = 0; i + 1 < x.size(); ++i)
      for (double t = 0; t <= 1; t += 0.05) {
        const double at = curve.at(x[i] + t * (x[i + 1] - x[i]));
        EXPECT_GE(at, std::min(y[i], y[i + 1]) - 1e-12);
        EXPECT_LE(at, std::max(y[i], y[i + 1]) + 1e-12);
      }
  }
}

TEST(MonotoneCurve, IsExactOnStraightLinesAndBeyondThem) {
  const std::vector<double> x{-2, -1.5, 0, 4, 4.5};
  std::vector<double> y;
  for (const double at : x) y.push_back(3 - 0.7 * at);
  const MonotoneCurve line(x, y);
  for (double at = -10; at <= 10; at += 0.13) EXPECT_NEAR(line.at(at), 3 - 0.7 * at, 1e-12);
}

TEST(MonotoneCurve, GoesOnStraightBeyondItsEnds) {
  const MonotoneCurve curve({0, 1, 3}, {0, 1, 9});
  EXPECT_NEAR(curve.at(-2), -2, 1e-12);
  EXPECT_NEAR(curve.at(5), 17, 1e-12);
  for (const double end : {0.0, 3.0})
    EXPECT_NEAR(curve.at(end - 1e-9), curve.at(end + 1e-9), 1e-7) << "no jump at " << end;
  EXPECT_EQ(MonotoneCurve({2}, {7}).at(-100), 7);
}

// A = L L' with L = {{2, 0, 0}, {1, 3, 0}, {-1, 2, 1}}, x = {1, -2, 4}.
TEST(SolveSpd, SolvesASystemMadeByHand) {
  const auto x = solve_spd({4, 2, -2, 2, 10, 5, -2, 5, 6}, {-8, 2, 12});
  ASSERT_EQ(x.size(), 3u);
  EXPECT_NEAR(x[0], 1, 1e-12);
  EXPECT_NEAR(x[1], -2, 1e-12);
  EXPECT_NEAR(x[2], 4, 1e-12);
}

TEST(SolveSpd, SolvesRandomSystems) {
  std::mt19937 random(4);
  for (std::size_t n = 1; n < 12; ++n) {
    std::vector<double> root(n * n), a(n * n, 0), x(n), b(n, 0);
    for (double& v : root) v = uniform(random) - 0.5;
    for (double& v : x) v = uniform(random) - 0.5;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) {
        for (std::size_t k = 0; k < n; ++k) a[i * n + j] += root[i * n + k] * root[j * n + k];
        a[i * n + j] += i == j ? 0.1 : 0;
        b[i] += a[i * n + j] * x[j];
      }
    const auto solved = solve_spd(a, b);
    for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(solved[i], x[i], 1e-9) << n;
  }
}

TEST(SolveSpd, ASingularDirectionGetsNothing) {
  EXPECT_EQ(solve_spd({4, 0, 0, 0}, {12, 5}), (std::vector<double>{3, 0}));
  EXPECT_EQ(solve_spd({0, 0, 0, 4}, {5, 12}), (std::vector<double>{0, 3}));
  EXPECT_EQ(solve_spd({1, 1, 1, 1}, {2, 2}), (std::vector<double>{2, 0})) << "a row twice";
  EXPECT_EQ(solve_spd({}, {}), std::vector<double>{});
}

// -------------------------------------------------- hulls

std::vector<RatePoint> random_points(unsigned seed, int count) {
  std::mt19937 random(seed);
  std::vector<RatePoint> out;
  for (int i = 0; i < count; ++i) {
    RatePoint p{{0.5, 10, 1, i}, 1 + 20 * uniform(random), uniform(random)};
    if (i % 5 == 4) p.mbps = out[random() % out.size()].mbps;  // ties
    if (i % 7 == 6) p.ssim = out[random() % out.size()].ssim;
    out.push_back(p);
  }
  return out;
}

/// The best that sharing time between two points gives within a rate, over all pairs.
double best_by_sharing(const std::vector<RatePoint>& points, double mbps) {
  double best = -1;
  for (const RatePoint& a : points) {
    if (a.mbps > mbps) continue;
    best = std::max(best, a.ssim);
    for (const RatePoint& b : points)
      if (b.mbps > mbps)
        best = std::max(best, a.ssim + (mbps - a.mbps) / (b.mbps - a.mbps) * (b.ssim - a.ssim));
  }
  return best;
}

TEST(ConvexHull, IsTheBestThatTimeSharingGives) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto points = random_points(seed, 40), hull = convex_hull(points);
    const auto least = std::ranges::min(points, {}, &RatePoint::mbps).mbps;
    for (double mbps = least; mbps < 25; mbps += 0.37)
      EXPECT_NEAR(hull_ssim(hull, mbps), best_by_sharing(points, mbps), 1e-12) << seed;
  }
}

TEST(ConvexHull, HoldsOnlyPointsThatNothingDominates) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto points = random_points(seed, 40), hull = convex_hull(points);
    for (std::size_t i = 0; i < hull.size(); ++i) {
      EXPECT_TRUE(std::ranges::any_of(points, [&](const RatePoint& p) {
        return p.setting == hull[i].setting && p.mbps == hull[i].mbps && p.ssim == hull[i].ssim;
      }));
      auto others = points;
      std::erase_if(others, [&](const RatePoint& p) {
        return p.mbps == hull[i].mbps && p.ssim == hull[i].ssim;
      });
      EXPECT_LT(best_by_sharing(others, hull[i].mbps), hull[i].ssim) << seed;
      if (i > 0) {
        EXPECT_GT(hull[i].mbps, hull[i - 1].mbps);
      }
    }
  }
}

TEST(ConvexHull, OfOnePointAndOfNone) {
  EXPECT_TRUE(convex_hull({}).empty());
  const auto hull = convex_hull({{{}, 3, 0.5}, {{}, 3, 0.6}, {{}, 4, 0.6}});
  ASSERT_EQ(hull.size(), 1u);
  EXPECT_EQ(hull[0].ssim, 0.6);
}

TEST(HullSsim, BetweenBelowAndBeyond) {
  const std::vector<RatePoint> hull{{{}, 2, 0.5}, {{}, 4, 0.8}, {{}, 10, 0.9}};
  EXPECT_EQ(hull_ssim(hull, 0), 0.5);
  EXPECT_EQ(hull_ssim(hull, 2), 0.5);
  EXPECT_NEAR(hull_ssim(hull, 3), 0.65, 1e-12);
  EXPECT_NEAR(hull_ssim(hull, 4), 0.8, 1e-12);
  EXPECT_NEAR(hull_ssim(hull, 7), 0.85, 1e-12);
  EXPECT_EQ(hull_ssim(hull, 10), 0.9);
  EXPECT_EQ(hull_ssim(hull, 1e9), 0.9);
}

TEST(HullTargets, ReachFromTheLowestRateToNearlyTheBestQuality) {
  const std::vector<RatePoint> hull{{{}, 2, 0.5}, {{}, 4, 0.8}, {{}, 10, 0.9}, {{}, 50, 0.902}};
  const auto targets = targets_of(hull, 7);
  ASSERT_EQ(targets.size(), 7u);
  EXPECT_NEAR(targets.front(), 2, 1e-12);
  EXPECT_NEAR(hull_ssim(hull, targets.back()), 0.5 + 0.99 * 0.402, 1e-9);
  for (std::size_t i = 1; i < 7; ++i)
    EXPECT_NEAR(targets[i] / targets[i - 1], targets[1] / targets[0], 1e-9);
  EXPECT_EQ(targets_of({{{}, 3, 0.5}}, 2), (std::vector<double>{3, 3}));
}

TEST(MeasuredPoints, AddTheRatesOfGeometryAndTexture) {
  Sweep sweep;
  sweep.fps = 10;
  sweep.geometries = {{1, 10, 1000, 5}, {2, 9, 500, 5}};
  sweep.textures = {{1, 30, 4000, 100}, {0.5, 40, 2000, 50}};
  sweep.qualities = {{1, 0, 0.7}};
  const auto points = measured_points(sweep);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].setting, (Setting{2, 9, 1, 30}));
  EXPECT_NEAR(points[0].mbps, (500 * 10 + 4000 + 9 * 100) * 8e-6, 1e-12);
  EXPECT_EQ(points[0].ssim, 0.7);
}

}  // namespace
}  // namespace mr::rate
