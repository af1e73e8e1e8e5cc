#pragma once

#include <map>
#include <optional>

#include "mr/codec/control.h"
#include "mr/core/frame.h"

namespace mr::codec {

/// When a receiver asks a node for what it lacks: at once, and for as long as it does not come
/// again after a while, so that requests and answers may be lost. No clock inside.
class ControlPacing {
 public:
  static constexpr Duration kKeyFrameEvery = std::chrono::milliseconds(500);  ///< of one stream
  static constexpr Duration kHeadEvery = std::chrono::milliseconds(500);
  static constexpr Duration kChunksEvery = std::chrono::milliseconds(100);

  /// The part of `lacking` that is to be asked for now, within the limits of one request; it counts
  /// as asked for. Words that need no answer pass.
  Control due(Control lacking, TimePoint now);

  /// The node began afresh: its key frames and chunks were never asked for.
  void begin_afresh();
  /// Streams that are no more are forgotten.
  template <typename IsGone>
  void forget_streams(IsGone is_gone) {
    std::erase_if(key_frames_, [&](const auto& item) { return is_gone(item.first); });
  }

 private:
  std::map<StreamId, TimePoint> key_frames_;  ///< asked for last, by stream
  std::optional<TimePoint> head_, chunks_;
};

}  // namespace mr::codec
