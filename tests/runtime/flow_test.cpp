#include "mr/runtime/flow.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace mr::runtime {
namespace {

constexpr TimePoint kStart{std::chrono::seconds(1'000'000)};

TEST(Handoff, HoldsOneAndKeepsTheOrder) {
  Handoff<int> handoff;
  std::jthread producer([&](const std::stop_token& stop) {
    for (int i = 0; i < 1000 && handoff.put(stop, i); ++i) continue;
  });
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(handoff.take({}), i);
}

TEST(Handoff, WhoIsToStopTakesNothingMore) {
  Handoff<int> handoff;
  ASSERT_TRUE(handoff.put({}, 1));
  std::stop_source stopped;
  stopped.request_stop();
  EXPECT_FALSE(handoff.take(stopped.get_token())) << "a slow stage that is fed would never end";
  EXPECT_EQ(handoff.take({}), 1);
  EXPECT_FALSE(handoff.put(stopped.get_token(), 2));
}

TEST(Handoff, StopEndsTheWait) {
  Handoff<int> handoff;
  std::optional<int> taken = 1;
  {
    std::jthread consumer([&](const std::stop_token& stop) { taken = handoff.take(stop); });
  }
  EXPECT_FALSE(taken);
}

TEST(Credit, RunsNotAheadOfItsConsumers) {
  Credit credit(1);
  EXPECT_TRUE(credit.try_begin(kStart));
  EXPECT_FALSE(credit.try_begin(kStart));
  credit.end(true);
  EXPECT_FALSE(credit.try_begin(kStart)) << "packet 0 was not taken yet";
  credit.taken(5);  // of another epoch
  EXPECT_FALSE(credit.try_begin(kStart));
  credit.taken(0);
  EXPECT_TRUE(credit.try_begin(kStart));
  credit.end(false);  // abandoned
  EXPECT_TRUE(credit.try_begin(kStart));
}

TEST(Credit, GoesOnWithoutWord) {
  Credit credit(1);
  ASSERT_TRUE(credit.try_begin(kStart));
  credit.end(true);
  EXPECT_FALSE(credit.try_begin(kStart + Credit::kPatience / 2));
  EXPECT_TRUE(credit.try_begin(kStart + Credit::kPatience));
}

}  // namespace
}  // namespace mr::runtime
