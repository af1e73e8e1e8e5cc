#pragma once

#include <cstdint>
#include <optional>

#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr {

/// Whether a frame was not lost but never captured: the sensor is slower than the scene, or its
/// recording has a gap.
inline bool is_gap(const Error& error) { return error.cause == Error::Cause::empty; }

/// A source of one sensor's frames. Not thread-safe: one reader.
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  /// The next frame; nothing at the end. An Error: this frame was lost (the message names the
  /// file), or there is none at its time (is_gap); the next call returns the frame after it.
  virtual Result<std::optional<Frame>> next() = 0;

  /// Skips this many frames without reading them; cheap. Frame i is captured at i / fps after
  /// the epoch, so skip(now * fps) puts an endless source in step with the wall clock.
  virtual void skip(std::uint64_t frames) = 0;

  /// Whether frames come from a device at its own pace. next() waits for the next frame, for a
  /// bounded time (some seconds at most; an Error: none came); times are those of this computer's
  /// clock, which the source maps the device's own clock to; there is nothing to skip; it has no
  /// end as long as it is not hopeless.
  virtual bool is_live() const { return false; }

  /// Whether the source starts again after its last frame; frame indices keep increasing.
  virtual bool endless() const = 0;
};

}  // namespace mr
