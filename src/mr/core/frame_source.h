#pragma once

#include <cstdint>
#include <optional>

#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr {

/// Where a sensor's frames come from. Not thread-safe: one reader.
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  /// The next frame; an Error when that one frame was lost (its message names the file; calling
  /// again goes on with the one after it); nothing at the end.
  virtual Result<std::optional<Frame>> next() = 0;

  /// Goes on as if so many more frames had been read; cheap. Frame i is captured at i / fps after
  /// the epoch, so skip(now * fps) puts an endless source in step with the wall clock.
  virtual void skip(std::uint64_t frames) = 0;

  /// Whether it starts again after its last frame; its indices count on.
  virtual bool endless() const = 0;
};

}  // namespace mr
