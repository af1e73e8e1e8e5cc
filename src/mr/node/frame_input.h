#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr::node {

/// Where a sensor's task takes its captures from: at the pace of whoever runs it.
class FrameInput {
 public:
  struct Captured {
    Frame frame;
    TimePoint read_at{};
  };
  /// Takes a frame that is skipped; returns whether it wants more of them.
  using Watch = std::function<bool(Frame)>;

  virtual ~FrameInput() = default;

  /// Whether there is a frame that was not given out yet, and when there will be the next.
  virtual bool is_ready(TimePoint now) = 0;
  virtual std::optional<TimePoint> due() const = 0;

  /// The newest frame that was not given out yet; an Error when that one was lost; nothing at the
  /// end. Of the frames in between a few go to `watch`, oldest first, as long as it wants them; the
  /// others are skipped.
  virtual Result<std::optional<Captured>> next(TimePoint now, const Watch& watch) = 0;

  /// Frames that nobody had time for, those watched included. Any thread.
  virtual std::uint64_t skipped() const = 0;
};

}  // namespace mr::node
