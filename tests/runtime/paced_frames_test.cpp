#include "mr/runtime/paced_frames.h"

#include <gtest/gtest.h>

namespace mr::runtime {
namespace {

using namespace std::chrono_literals;

/// Numbered frames.
class Numbers final : public FrameSource {
 public:
  explicit Numbers(bool endless) : endless_(endless) {}
  Result<std::optional<Frame>> next() override {
    Frame frame;
    frame.index = next_++;
    return std::optional(frame);
  }
  void skip(std::uint64_t frames) override { next_ += frames; }
  bool endless() const override { return endless_; }

 private:
  bool endless_;
  std::uint64_t next_ = 0;
};

class PacedFramesTest : public testing::Test {
 protected:
  PacedFrames open(bool endless, double fps = 100) {
    return {std::make_unique<Numbers>(endless), fps, [this] { return now_; }};
  }
  TimePoint now_{1'000'000s};
};

TEST_F(PacedFramesTest, EachFrameIsGivenOutOnceWhenItsTimeComes) {
  PacedFrames paced = open(false);
  for (std::uint64_t i = 0; i < 5; ++i, now_ += 10ms) {
    ASSERT_TRUE(paced.is_ready(now_)) << i;
    EXPECT_EQ((*paced.next(now_, {}))->frame.index, i);
    EXPECT_FALSE(paced.is_ready(now_));
    EXPECT_EQ(paced.due(), now_ + 10ms);
  }
  EXPECT_EQ(paced.skipped(), 0u);
}

TEST_F(PacedFramesTest, EndlessSourcesOfAllProcessesAreInStep) {
  PacedFrames one = open(true);
  now_ += 12345ms;
  PacedFrames late = open(true);
  ASSERT_TRUE(one.is_ready(now_) && late.is_ready(now_));
  EXPECT_EQ((*one.next(now_, {}))->frame.index, (*late.next(now_, {}))->frame.index);
}

TEST_F(PacedFramesTest, AClockThatIsSetBackStopsNothing) {
  PacedFrames paced = open(false);
  now_ += 1h;
  const std::uint64_t last = (*paced.next(now_, {}))->frame.index;
  now_ -= 1h;
  ASSERT_TRUE(paced.is_ready(now_));
  EXPECT_EQ((*paced.next(now_, {}))->frame.index, last + 1);
}

TEST_F(PacedFramesTest, SomeOfWhatIsSkippedIsWatchedInOrder) {
  PacedFrames paced = open(true);
  std::uint64_t last = (*paced.next(now_, {}))->frame.index;
  for (const std::size_t wanted : {0, 2, 100}) {
    now_ += 300ms;
    const std::uint64_t skipped_before = paced.skipped();
    std::vector<std::uint64_t> watched;
    const auto watch = [&](const Frame& frame) {
      watched.push_back(frame.index);
      return watched.size() < wanted;
    };
    const auto taken = paced.next(now_, wanted > 0 ? watch : PacedFrames::Watch());
    ASSERT_TRUE(taken.ok() && *taken);
    EXPECT_EQ(watched.size(), std::min<std::size_t>(wanted, 16));
    for (const std::uint64_t index : watched) {
      EXPECT_GT(index, last);
      last = index;
    }
    EXPECT_GT((*taken)->frame.index, last);
    EXPECT_EQ(paced.skipped() - skipped_before, 29u);
    last = (*taken)->frame.index;
  }
}

}  // namespace
}  // namespace mr::runtime
