#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr::node {

/// The captures of a sensor's task. The executor implements it and sets the pace: lockstep or live.
class FrameInput {
 public:
  struct Captured {
    Frame frame;
    TimePoint read_at{};
  };
  /// Receives a skipped frame; returns whether it accepts another one.
  using Watch = std::function<bool(Frame)>;

  virtual ~FrameInput() = default;

  /// is_ready: whether a frame is waiting; due: when the next one will be.
  virtual bool is_ready(TimePoint now) = 0;
  virtual std::optional<TimePoint> due() const = 0;

  /// Takes the newest waiting frame; an Error: this frame was lost; nothing at the end. Older
  /// waiting frames are skipped; some of them are passed to `watch`, oldest first, while it accepts
  /// more.
  virtual Result<std::optional<Captured>> next(TimePoint now, const Watch& watch) = 0;

  /// Called once: `wake` is called, on any thread, when a frame has come that due() did not tell.
  virtual void wake_by(std::function<void()> /*wake*/) {}

  /// Number of skipped frames, including those passed to `watch`. Any thread.
  virtual std::uint64_t skipped() const = 0;
};

}  // namespace mr::node
