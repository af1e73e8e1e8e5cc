#include "mr/runtime/live_frames.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <thread>

#include "mr/runtime/flow.h"

namespace mr::runtime {
namespace {

using namespace std::chrono_literals;

/// A device: next() waits until the test delivers something.
class Device {
 public:
  class Source final : public FrameSource {
   public:
    explicit Source(Device& device) : device_(device) {}
    Result<std::optional<Frame>> next() override { return device_.wait(); }
    void skip(std::uint64_t) override {}
    bool endless() const override { return true; }
    bool is_live() const override { return true; }

   private:
    Device& device_;
  };

  void deliver(Result<std::optional<Frame>> given) {
    {
      const std::lock_guard lock(mutex_);
      given_.push_back(std::move(given));
    }
    changed_.notify_all();
  }
  void deliver(std::uint64_t index, int width = 0) {
    Frame frame;
    frame.index = index;
    frame.depth = ImageDepth(width, width);
    deliver(std::optional(std::move(frame)));
  }
  /// Until the reader waits for more.
  void until_read() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return given_.empty() && waiting_; });
  }
  Result<std::optional<Frame>> wait() {
    std::unique_lock lock(mutex_);
    waiting_ = true;
    changed_.notify_all();
    if (!changed_.wait_for(lock, patience, [&] { return !given_.empty(); })) {
      waiting_ = false;
      return Error{Error::Cause::io, "no frame"};
    }
    waiting_ = false;
    auto out = std::move(given_.front());
    given_.pop_front();
    return out;
  }

  std::chrono::milliseconds patience = 10s;

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Result<std::optional<Frame>>> given_;
  bool waiting_ = false;
};

class LiveFramesTest : public testing::Test {
 protected:
  LiveFrames open(std::size_t kept_bytes = 1'000'000) {
    return {std::make_unique<Device::Source>(device_), [this] { return TimePoint(now_.load()); },
            kept_bytes};
  }
  /// Ends the reader's wait.
  void end() { device_.deliver(std::optional<Frame>()); }

  Device device_;
  std::atomic<Duration> now_{Duration(1000s)};
};

TEST_F(LiveFramesTest, GivesTheNewestFrameWithTheTimeAtWhichItWasRead) {
  LiveFrames frames = open();
  EXPECT_FALSE(frames.is_ready({}));
  EXPECT_EQ(frames.due(), std::nullopt);
  device_.deliver(0);
  device_.until_read();
  now_ = Duration(2000s);
  ASSERT_TRUE(frames.is_ready({}));
  const auto captured = frames.next({}, {});
  ASSERT_TRUE(captured.ok() && *captured);
  EXPECT_EQ((*captured)->frame.index, 0u);
  EXPECT_EQ((*captured)->read_at, TimePoint(1000s)) << "not when it was taken";
  EXPECT_FALSE(frames.is_ready({})) << "a frame is given once";
  EXPECT_EQ(frames.skipped(), 0u);
  end();
}

TEST_F(LiveFramesTest, WhatIsSkippedIsCountedAndTheNewestOfItWatchedInOrder) {
  LiveFrames frames = open();
  for (std::uint64_t i = 0; i < 40; ++i) device_.deliver(i);
  device_.until_read();
  std::vector<std::uint64_t> watched;
  const auto captured = frames.next({}, [&](const Frame& frame) {
    watched.push_back(frame.index);
    return true;
  });
  ASSERT_TRUE(captured.ok() && *captured);
  EXPECT_EQ((*captured)->frame.index, 39u);
  ASSERT_EQ(watched.size(), LiveFrames::kKept);
  for (std::size_t i = 0; i < watched.size(); ++i) EXPECT_EQ(watched[i], 39 - 16 + i);
  EXPECT_EQ(frames.skipped(), 39u);
  end();
}

TEST_F(LiveFramesTest, WatchingStopsWhenNoMoreIsWanted) {
  LiveFrames frames = open();
  for (std::uint64_t i = 0; i < 5; ++i) device_.deliver(i);
  device_.until_read();
  int watched = 0;
  EXPECT_TRUE(frames.next({}, [&](const Frame&) { return ++watched < 2; }).ok());
  EXPECT_EQ(watched, 2);
  EXPECT_EQ(frames.skipped(), 4u);
  end();
}

TEST_F(LiveFramesTest, LargePicturesAreKeptInFewerFrames) {
  LiveFrames frames = open(160'000);
  for (std::uint64_t i = 0; i < 8; ++i) device_.deliver(i, 100);  // 40 kB each
  device_.until_read();
  int watched = 0;
  const auto captured = frames.next({}, [&](const Frame&) { return ++watched > 0; });
  EXPECT_EQ((*captured)->frame.index, 7u);
  EXPECT_EQ(watched, 3);
  EXPECT_EQ(frames.skipped(), 7u);
  end();
}

TEST_F(LiveFramesTest, FailuresAreReportedAndTheStreamGoesOn) {
  LiveFrames frames = open();
  device_.deliver(0);
  device_.deliver(Error{Error::Cause::corrupt, "a picture"});
  device_.deliver(1);
  device_.until_read();
  const auto failed = frames.next({}, {});
  ASSERT_FALSE(failed.ok());
  EXPECT_EQ(failed.error().message, "a picture");
  ASSERT_TRUE(frames.is_ready({}));
  EXPECT_EQ((*frames.next({}, {}))->frame.index, 1u);
  end();
}

TEST_F(LiveFramesTest, FailuresAreBounded) {
  LiveFrames frames = open();
  for (int i = 0; i < 30; ++i) device_.deliver(Error{Error::Cause::io, std::to_string(i)});
  device_.until_read();
  EXPECT_EQ(frames.next({}, {}).error().message, "14") << "the oldest were dropped";
  for (int i = 1; i < 16; ++i) EXPECT_FALSE(frames.next({}, {}).ok());
  EXPECT_FALSE(frames.is_ready({}));
  end();
}

TEST_F(LiveFramesTest, EndsWhenTheSourceDoes) {
  LiveFrames frames = open();
  device_.deliver(0);
  end();
  while (!frames.is_ready({})) std::this_thread::yield();
  EXPECT_TRUE(frames.next({}, {})->has_value());
  while (!frames.is_ready({})) std::this_thread::yield();
  EXPECT_FALSE(frames.next({}, {})->has_value());
}

TEST_F(LiveFramesTest, AFrameWakesItsTask) {
  Signal signal;  // outlives the reader
  LiveFrames frames = open();
  frames.wake_by([&] { signal.notify(); });
  const auto start = std::chrono::steady_clock::now();
  device_.deliver(0);
  signal.wait({}, 60s);
  EXPECT_LT(std::chrono::steady_clock::now() - start, 30s);
  EXPECT_TRUE(frames.is_ready({}));
  end();
}

TEST_F(LiveFramesTest, StopsWithinTheSourcesPatience) {
  device_.patience = 20ms;
  LiveFrames frames = open();
  while (!frames.is_ready({})) std::this_thread::yield();
  EXPECT_EQ(frames.next({}, {}).error().message, "no frame");
}  // the destructor joins

}  // namespace
}  // namespace mr::runtime
