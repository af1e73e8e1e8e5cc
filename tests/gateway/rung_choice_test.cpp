#include "mr/gateway/rung_choice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

namespace mr::gateway {
namespace {

using Rates = std::vector<double>;
using Moves = std::vector<std::pair<net::ViewerId, std::size_t>>;

TEST(RungChoice, WhoeverSaysNothingGetsTheMost) {
  RungChoice choice(3, 20);
  EXPECT_EQ(choice.ladder(), Rates{20}) << "nobody watches";
  choice.opened(1);
  EXPECT_EQ(choice.ladder(), Rates{20});
  EXPECT_TRUE(choice.moves().empty());
  EXPECT_TRUE(choice.want(1, 500));
  EXPECT_EQ(choice.ladder(), Rates{20}) << "there is no more than the most";
}

TEST(RungChoice, OneViewerStaysOnTheRootsOwnStream) {
  RungChoice choice(3, 20);
  choice.opened(1);
  for (const double mbps : {3.0, 0.5, 12.0}) {
    EXPECT_TRUE(choice.want(1, mbps));
    EXPECT_EQ(choice.ladder(), Rates{mbps});
    EXPECT_TRUE(choice.moves().empty());
  }
}

TEST(RungChoice, WhoeverWantsLessMovesToARungOfItsOwn) {
  RungChoice choice(3, 20);
  choice.opened(1), choice.opened(2);
  EXPECT_TRUE(choice.want(1, 3));
  EXPECT_EQ(choice.ladder(), (Rates{20, 3}));
  EXPECT_EQ(choice.moves(), (Moves{{1, 1}}));
  EXPECT_EQ(choice.served_by(1), 0u) << "until its stream is there";
  choice.moved(1, 1);
  EXPECT_TRUE(choice.moves().empty());
  choice.closed(2);
  EXPECT_EQ(choice.ladder(), Rates{3});
  EXPECT_EQ(choice.moves(), (Moves{{1, 0}}));
  choice.moved(1, 0);
  EXPECT_TRUE(choice.want(1, 20));
  EXPECT_TRUE(choice.moves().empty());
}

TEST(RungChoice, OneStreamHasTheLeastThatAnybodyWants) {
  RungChoice choice(1, 20);
  choice.opened(1), choice.opened(2);
  EXPECT_TRUE(choice.want(2, 4));
  EXPECT_EQ(choice.ladder(), Rates{4});
  EXPECT_TRUE(choice.moves().empty());
}

TEST(RungChoice, WhatIsNoRateChangesNothing) {
  RungChoice choice(3, 20);
  choice.opened(1);
  EXPECT_TRUE(choice.want(1, 3));
  for (const double bad : {0.0, -2.0, 1e308 * 10, std::nan("")}) EXPECT_FALSE(choice.want(1, bad));
  EXPECT_EQ(choice.ladder(), Rates{3});
  EXPECT_TRUE(choice.want(7, 5)) << "who has left";
  EXPECT_EQ(choice.ladder(), Rates{3});
  EXPECT_EQ(choice.served_by(7), 0u);
}

}  // namespace
}  // namespace mr::gateway
