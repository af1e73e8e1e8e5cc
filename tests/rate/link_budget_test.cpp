#include "mr/rate/link_budget.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace mr::rate {
namespace {

using std::chrono::milliseconds;

/// A sender of 30 packets a second, coarser as its receiver asks, over a link with a queue.
struct Link {
  explicit Link(double carries, std::optional<double> of_scene = {})
      : mbps(carries), budget(of_scene) {}

  /// Runs for some seconds, at `wanted` Mbit/s as planned. Returns what was sent in the last one.
  double run(double seconds, double wanted) {
    double last = 0;
    const int packets = static_cast<int>(seconds * 30);
    for (int i = 0; i < packets; ++i) {
      now += Duration(1'000'000'000 / 30);
      const double bytes = wanted / 8e-6 / 30 * std::exp(-0.1155 * budget.coarser());
      free_at = std::max(free_at, now) + std::chrono::duration_cast<Duration>(
                                             std::chrono::duration<double>(bytes * 8e-6 / mbps));
      longest_wait = i >= packets - 30 ? std::max(longest_wait, free_at - now) : Duration{};
      // A constant delay, and a clock that is an hour wrong.
      budget.arrived(bytes, has_marks ? std::optional(now - std::chrono::hours(1)) : std::nullopt,
                     free_at + milliseconds(15));
      if (i >= packets - 30) last += bytes * 8e-6;
    }
    return last;
  }

  double mbps;
  LinkBudget budget;
  bool has_marks = true;
  TimePoint now{}, free_at{};
  Duration longest_wait{};  ///< in the last second of the last run
};

TEST(LinkBudget, WhatFitsIsLeftAsItIs) {
  Link link(20);
  link.run(20, 12);
  EXPECT_EQ(link.budget.coarser(), 0);
  EXPECT_FALSE(link.budget.limit_mbps());
  EXPECT_NEAR(link.budget.mbps(), 12, 0.5);
}

TEST(LinkBudget, MeasuresWhatALinkCarriesAndStaysWithinIt) {
  for (const double carries : {2.0, 5.0, 15.0}) {
    Link link(carries);
    link.run(12, 20);
    EXPECT_GT(link.budget.coarser(), 0) << carries;
    const double sent = link.run(10, 20);
    EXPECT_LT(sent, carries * 1.02) << "the queue does not grow";
    EXPECT_GT(sent, 0.55 * carries) << "and the link is used";
    EXPECT_LT(link.longest_wait, milliseconds(400)) << carries;
  }
}

TEST(LinkBudget, UsesALinkThatCarriesMoreAgain) {
  Link link(4);
  link.run(15, 20);
  link.mbps = 50;
  link.run(60, 20);
  EXPECT_LE(link.budget.coarser(), 2);
}

TEST(LinkBudget, KeepsToTheLimitOfTheScene) {
  Link link(1000, 6.0);
  link.has_marks = false;  // in virtual time there are none
  link.run(10, 20);
  const double sent = link.run(5, 20);
  EXPECT_LT(sent, 6.1);
  EXPECT_GT(sent, 4);
  EXPECT_EQ(link.budget.limit_mbps(), 6.0);
}

TEST(LinkBudget, GoesNoFurtherThanTheCoarsest) {
  Link link(0.01, 0.01);
  link.run(30, 20);
  EXPECT_EQ(link.budget.coarser(), LinkBudget::kCoarsest);
}

}  // namespace
}  // namespace mr::rate
