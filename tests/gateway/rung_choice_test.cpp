#include "mr/gateway/rung_choice.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace mr::gateway {
namespace {

using namespace std::chrono_literals;
using Rates = std::vector<std::optional<double>>;
using Moves = std::vector<std::pair<net::ViewerId, std::size_t>>;

constexpr TimePoint kStart{1h};
constexpr std::nullopt_t kNone = std::nullopt;

/// As if every stream were there at once.
void move_all(RungChoice& choice, TimePoint now) {
  choice.update(now);
  for (const auto& [viewer, stream] : Moves(choice.moves())) choice.moved(viewer, stream, now);
  choice.update(now);
}

/// Two viewers who have said what they want.
RungChoice with_two(double first_mbps, double second_mbps, std::size_t streams = 3) {
  RungChoice out(streams, 20);
  out.opened(1, kStart), out.opened(2, kStart);
  EXPECT_TRUE(out.want(1, first_mbps) && out.want(2, second_mbps));
  out.update(kStart);
  return out;
}

TEST(RungChoice, WhoeverSaysNothingGetsTheMost) {
  RungChoice choice(3, 20);
  choice.update(kStart);
  EXPECT_EQ(choice.rates(), (Rates{20, kNone, kNone})) << "nobody watches";
  choice.opened(1, kStart);
  choice.update(kStart);
  EXPECT_EQ(choice.rates(), (Rates{20, kNone, kNone}));
  EXPECT_TRUE(choice.want(1, 500));
  choice.update(kStart);
  EXPECT_EQ(choice.rates(), (Rates{20, kNone, kNone})) << "there is no more than the most";
  EXPECT_TRUE(choice.moves().empty());
}

TEST(RungChoice, OneViewerStaysOnTheRootsOwnStream) {
  RungChoice choice(3, 20);
  choice.opened(1, kStart);
  for (const double mbps : {3.0, 0.5, 12.0}) {
    EXPECT_TRUE(choice.want(1, mbps));
    choice.update(kStart);
    EXPECT_EQ(choice.rates(), (Rates{mbps, kNone, kNone}));
    EXPECT_TRUE(choice.moves().empty());
  }
}

TEST(RungChoice, WhoeverWantsLessMovesOnceItsStreamIsThere) {
  RungChoice choice = with_two(3, 20);
  EXPECT_EQ(choice.rates(), (Rates{20, 3, kNone}));
  EXPECT_EQ(choice.moves(), (Moves{{1, 1}}));
  EXPECT_EQ(choice.served_by(1), 0u);
  choice.moved(1, 1, kStart);
  choice.update(kStart);
  EXPECT_TRUE(choice.moves().empty());
  choice.closed(2);
  choice.update(kStart + 1s);
  EXPECT_EQ(choice.rates(), (Rates{3, kNone, kNone}));
  EXPECT_TRUE(choice.moves().empty()) << "it has just moved";
  choice.update(kStart + RungChoice::kStay);
  EXPECT_EQ(choice.moves(), (Moves{{1, 0}}));
}

TEST(RungChoice, OthersStayWhereTheyAreWhenOneChangesItsMind) {
  RungChoice choice(3, 20);
  for (const net::ViewerId viewer : {1, 2, 3}) choice.opened(viewer, kStart);
  EXPECT_TRUE(choice.want(1, 20) && choice.want(2, 8) && choice.want(3, 3));
  move_all(choice, kStart);
  const std::size_t of_third = choice.served_by(3);
  EXPECT_NE(of_third, choice.served_by(2));
  TimePoint now = kStart + 10s;
  for (int i = 0; i < 20; ++i, now += 10s) {
    EXPECT_TRUE(choice.want(2, i % 2 == 0 ? 1 : 8));  // below the third, and above it
    move_all(choice, now);
    EXPECT_EQ(choice.served_by(3), of_third);
    EXPECT_EQ(choice.rates()[of_third], 3);
  }
}

TEST(RungChoice, AStreamBecomesRicherOnceThoseHaveLeftThatWantLess) {
  RungChoice choice(3, 20);
  choice.opened(1, kStart);
  EXPECT_TRUE(choice.want(1, 0.5));
  choice.update(kStart);
  choice.opened(2, kStart);
  choice.update(kStart + 500ms);
  EXPECT_EQ(choice.rates(), (Rates{0.5, kNone, kNone})) << "it may be about to say what it wants";
  choice.update(kStart + 2s);
  EXPECT_EQ(choice.rates(), (Rates{0.5, 0.5, kNone}));
  ASSERT_EQ(choice.moves(), (Moves{{1, 1}}));
  choice.moved(1, 1, kStart + 3s);
  choice.update(kStart + 3s);
  EXPECT_EQ(choice.rates(), (Rates{20, 0.5, kNone}));
}

TEST(RungChoice, ButDoesNotWaitForEver) {
  RungChoice choice = with_two(0.5, 0.5);
  EXPECT_TRUE(choice.want(2, 20));
  choice.update(kStart);
  EXPECT_EQ(choice.rates().front(), 0.5);
  choice.update(kStart + RungChoice::kLeave);
  EXPECT_EQ(choice.rates().front(), 20);
}

TEST(RungChoice, WhoGoesDownTakesNothingFromTheOthers) {
  RungChoice choice = with_two(20, 20);
  EXPECT_TRUE(choice.want(2, 1));
  choice.update(kStart);
  EXPECT_EQ(choice.rates(), (Rates{20, 1, kNone}));
}

TEST(RungChoice, OneStreamHasTheLeastThatAnybodyWants) {
  RungChoice choice = with_two(20, 4, 1);
  EXPECT_EQ(choice.rates(), Rates{4});
  EXPECT_TRUE(choice.moves().empty());
}

TEST(RungChoice, WhatIsNoRateChangesNothing) {
  RungChoice choice(3, 20);
  choice.opened(1, kStart);
  EXPECT_TRUE(choice.want(1, 3));
  for (const double bad : {0.0, -2.0, 1e308 * 10, std::nan("")}) EXPECT_FALSE(choice.want(1, bad));
  EXPECT_TRUE(choice.want(7, 5)) << "who has left";
  choice.update(kStart);
  EXPECT_EQ(choice.rates(), (Rates{3, kNone, kNone}));
  EXPECT_EQ(choice.served_by(7), 0u);
}

}  // namespace
}  // namespace mr::gateway
