#include "mr/rate/ladder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace mr::rate {
namespace {

using Rates = std::vector<double>;

TEST(Ladder, OneRateForWhoeverWantsAboutTheSame) {
  EXPECT_EQ(ladder_for({}, 3), Rates{});
  EXPECT_EQ(ladder_for({5}, 3), Rates{5});
  EXPECT_EQ(ladder_for({5, 5, 5}, 3), Rates{5});
  EXPECT_EQ(ladder_for({5.5, 5, 6}, 3), Rates{5}) << "nobody gets more than it wants";
}

TEST(Ladder, ARateForEachAsFarAsThereAreRungs) {
  EXPECT_EQ(ladder_for({2, 30}, 3), (Rates{30, 2}));
  EXPECT_EQ(ladder_for({30, 2, 8}, 3), (Rates{30, 8, 2}));
  EXPECT_EQ(ladder_for({30, 2, 8}, 1), Rates{2});
  EXPECT_EQ(ladder_for({30, 2, 8, 7, 29}, 3), (Rates{29, 7, 2}));
}

TEST(Ladder, WhereThereAreTooFewMostOfThemLoseLittle) {
  EXPECT_EQ(ladder_for({30, 28, 26, 25, 10, 2, 1.9}, 2), (Rates{25, 1.9}))
      << "one loses much, rather than four a part";
  EXPECT_EQ(ladder_for({30, 30, 30, 30, 30, 30, 10, 2, 1}, 2).front(), 30) << "six of nine";
}

/// What viewers lose, by the logarithm.
double loss(const Rates& wanted, const Rates& ladder) {
  double out = 0;
  for (const double w : wanted) out += std::log(w / ladder[rung_for(w, ladder)]);
  return out;
}

TEST(Ladder, NoOtherOneLosesLess) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> rate(0, 3);
  for (int round = 0; round < 40; ++round) {
    Rates wanted(7);
    for (double& w : wanted) w = std::pow(10, rate(random));
    const Rates ladder = ladder_for(wanted, 3);
    ASSERT_TRUE(std::ranges::is_sorted(ladder, std::greater<>()));
    ASSERT_EQ(ladder.back(), std::ranges::min(wanted));
    if (ladder.size() < 3) continue;  // good enough for all
    for (const double a : wanted)
      for (const double b : wanted) {
        Rates other{std::max(a, b), std::min(a, b), ladder.back()};
        EXPECT_GE(loss(wanted, other), loss(wanted, ladder) - 1e-9);
      }
  }
}

TEST(Ladder, ThousandsOfViewersAreQuick) {
  Rates wanted;
  for (int i = 1; i <= 5000; ++i) wanted.push_back(i);
  const Rates ladder = ladder_for(wanted, 3);
  EXPECT_EQ(ladder.size(), 3u);
  EXPECT_GT(ladder.front(), 1000);
}

}  // namespace
}  // namespace mr::rate
