#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "mr/core/frame_source.h"
#include "mr/node/frame_input.h"
#include "mr/node/node_clock.h"

namespace mr::runtime {

/// Reads a device's frames as they come (FrameSource::is_live), on a thread of its own, and keeps
/// them until they are taken. A bounded latest-queue: next() takes the newest frame; of older ones
/// that nobody had time for, the newest kKept are kept for `watch`, the others are counted only.
/// Destruction waits for the source's next frame, or its error.
class LiveFrames final : public node::FrameInput {
 public:
  static constexpr std::size_t kKept = 16;  ///< frames beside the newest, or failures

  /// The source must be live. `clock`: tells when a frame was read; any thread. `kept_bytes`: of
  /// pictures; the newest frame is kept whatever its size.
  LiveFrames(std::unique_ptr<FrameSource> source, node::Clock clock,
             std::size_t kept_bytes = 256'000'000);

  bool is_ready(TimePoint now) override;
  std::optional<TimePoint> due() const override { return std::nullopt; }  // it wakes
  /// Failures come first, oldest first, and then the newest frame.
  Result<std::optional<Captured>> next(TimePoint now, const Watch& watch) override;
  void wake_by(std::function<void()> wake) override;
  std::uint64_t skipped() const override;

 private:
  void read(const std::stop_token& stop);
  bool keep(Result<std::optional<Frame>> frame);
  void keep_newest(Frame frame);

  const std::unique_ptr<FrameSource> source_;
  const node::Clock clock_;
  const std::size_t kept_bytes_;
  mutable std::mutex mutex_;
  std::condition_variable_any failed_;  ///< never notified: waits are for a time, or for the stop
  // Below: guarded by mutex_.
  std::function<void()> wake_;
  std::deque<Captured> frames_;  ///< oldest first
  std::size_t bytes_ = 0;        ///< of their pictures
  std::deque<Error> errors_;     ///< oldest first
  bool ended_ = false;
  std::uint64_t skipped_ = 0;
  std::jthread reader_;  // last: it uses the members above
};

}  // namespace mr::runtime
