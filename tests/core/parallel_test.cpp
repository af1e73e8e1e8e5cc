#include "mr/core/parallel.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <atomic>
#include <cmath>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

namespace mr {
namespace {

/// Eight threads also on a machine with fewer cores.
class Parallel : public testing::Test {
  tbb::global_control eight_{tbb::global_control::max_allowed_parallelism, 8};
};

std::vector<double> filled(int threads, std::size_t count, std::size_t grain) {
  std::vector<double> out(count, -1);
  Arena arena(threads);
  arena.run([&] {
    parallel_for(count, grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) out[i] = std::sin(static_cast<double>(i));
    });
  });
  return out;
}

TEST_F(Parallel, SameResultOnAnyNumberOfThreads) {
  constexpr std::size_t kCount = 100'003;
  const std::vector<double> serial = filled(1, kCount, 64);
  EXPECT_EQ(serial[kCount - 1], std::sin(static_cast<double>(kCount - 1)));
  EXPECT_EQ(filled(2, kCount, 64), serial);
  EXPECT_EQ(filled(8, kCount, 64), serial);
  EXPECT_EQ(filled(8, kCount, 0), serial) << "a grain of 0 counts as 1";
}

TEST_F(Parallel, PiecesCoverEveryIndexOnce) {
  std::vector<std::atomic<int>> hits(10'000);
  Arena arena(8);
  arena.run([&] {
    parallel_for(hits.size(), 7, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) ++hits[i];
    });
  });
  for (const auto& hit : hits) ASSERT_EQ(hit, 1);
}

TEST_F(Parallel, SerialBelowOneGrain) {
  int calls = 0;
  const auto caller = std::this_thread::get_id();
  parallel_for(100, 100, [&](std::size_t begin, std::size_t end) {
    ++calls;
    EXPECT_EQ(std::this_thread::get_id(), caller);
    EXPECT_EQ(begin, 0u);
    EXPECT_EQ(end, 100u);
  });
  EXPECT_EQ(calls, 1);
  parallel_for(0, 1, [&](std::size_t, std::size_t) { ++calls; });
  EXPECT_EQ(calls, 1);
}

TEST_F(Parallel, ExceptionsReachTheCaller) {
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    EXPECT_THROW(arena.run([&] {
      parallel_for(1000, 1, [](std::size_t begin, std::size_t end) {
        if (begin <= 500 && 500 < end) throw std::runtime_error("one piece failed");
      });
    }),
                 std::runtime_error);
    EXPECT_EQ(filled(threads, 5, 1).size(), 5u) << "works on after an exception";
  }
}

TEST_F(Parallel, AnArenaHasTheThreadsItWasGiven) {
  EXPECT_EQ(Arena(3).threads(), 3);
  EXPECT_GE(Arena(0).threads(), 1);
}

}  // namespace
}  // namespace mr
