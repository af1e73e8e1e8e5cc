#pragma once

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
};

}  // namespace mr
