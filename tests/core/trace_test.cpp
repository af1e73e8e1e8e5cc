#include "mr/core/trace.h"

#include <gtest/gtest.h>

#include <thread>

namespace mr {
namespace {

TEST(Percentile, InterpolatesBetweenSamples) {
  EXPECT_DOUBLE_EQ(percentile({4, 1, 3, 2}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(percentile({10, 20, 30, 40, 50}, 0.95), 48);
  EXPECT_DOUBLE_EQ(percentile({10, 20, 30, 40, 50}, 0.25), 20);
}

TEST(Percentile, EndsAndOddInputs) {
  EXPECT_DOUBLE_EQ(percentile({}, 0.5), 0);
  EXPECT_DOUBLE_EQ(percentile({7}, 0.95), 7);
  EXPECT_DOUBLE_EQ(percentile({3, 1, 2}, 0), 1);
  EXPECT_DOUBLE_EQ(percentile({3, 1, 2}, 1), 3);
  EXPECT_DOUBLE_EQ(percentile({3, 1, 2}, -4), 1);
  EXPECT_DOUBLE_EQ(percentile({3, 1, 2}, 4), 3);
}

TEST(Trace, TimesAStageAndHandsOnItsValue) {
  Trace trace;
  const int value = trace.time("fuse", [] {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    return 42;
  });
  EXPECT_EQ(value, 42);
  trace.add("encode", 1.5);
  trace.add("encode", 2.5);
  const auto stages = trace.stages();
  ASSERT_EQ(stages.size(), 2u);
  ASSERT_EQ(stages.at("fuse").size(), 1u);
  EXPECT_GE(stages.at("fuse")[0], 2);
  EXPECT_EQ(stages.at("encode"), (std::vector<double>{1.5, 2.5}));
}

TEST(Trace, TakesTimesFromManyThreads) {
  Trace trace;
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t)
      threads.emplace_back([&] {
        for (int i = 0; i < 500; ++i) trace.add("stage", i);
      });
  }
  EXPECT_EQ(trace.stages().at("stage").size(), 2000u);
}

TEST(DropCounter, CountsByPlaceAndCause) {
  DropCounter drops;
  drops.count("view-0", {Error::Cause::corrupt, "a.png is truncated"});
  drops.count("view-0", {Error::Cause::corrupt, "b.png is truncated"});
  drops.count("root", {Error::Cause::io, "no"});
  const auto counts = drops.by_cause();
  ASSERT_EQ(counts.size(), 2u);
  EXPECT_EQ(counts.at("view-0: corrupt"), 2u);
  EXPECT_EQ(counts.at("root: io"), 1u);
  EXPECT_EQ(drops.total(), 3u);
}

}  // namespace
}  // namespace mr
