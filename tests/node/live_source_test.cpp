#include "mr/node/live_source.h"

#include <gtest/gtest.h>

#include <thread>

namespace mr::node {
namespace {

/// Numbered frames without end.
class Numbers final : public FrameSource {
 public:
  Result<std::optional<Frame>> next() override {
    Frame frame;
    frame.index = next_++;
    return std::optional(frame);
  }
  void skip(std::uint64_t frames) override { next_ += frames; }
  bool endless() const override { return true; }

 private:
  std::uint64_t next_ = 0;
};

TEST(LiveSource, SomeOfWhatIsSkippedIsWatchedInOrder) {
  LiveSource source(std::make_unique<Numbers>(), 100);
  const std::stop_token never;
  std::uint64_t last = (*source.newest(never))->index;
  for (const std::size_t wanted : {0, 2, 100}) {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    const std::uint64_t skipped_before = source.skipped();
    std::vector<std::uint64_t> watched;
    const auto watch = [&](const Frame& frame) {
      watched.push_back(frame.index);
      return watched.size() < wanted;
    };
    const auto frame = wanted > 0 ? source.newest(never, watch) : source.newest(never);
    ASSERT_TRUE(frame.ok() && *frame);
    EXPECT_EQ(watched.size(), std::min<std::size_t>(wanted, 16));
    for (const std::uint64_t index : watched) {
      EXPECT_GT(index, last);
      last = index;
    }
    EXPECT_GT((*frame)->index, last);
    EXPECT_GE(source.skipped() - skipped_before, 29u);
    last = (*frame)->index;
  }
}

}  // namespace
}  // namespace mr::node
