#pragma once

#include <map>
#include <optional>

#include "mr/codec/control.h"
#include "mr/core/frame.h"

namespace mr::codec {

/// Retransmission timer of requests: a receiver requests what it lacks at once and repeats the
/// request at intervals until the data arrives, as requests and answers may be lost. No clock
/// inside.
class ControlPacing {
 public:
  static constexpr Duration kKeyFrameEvery = std::chrono::milliseconds(500);  ///< of one stream
  static constexpr Duration kHeadEvery = std::chrono::milliseconds(500);
  static constexpr Duration kChunksEvery = std::chrono::milliseconds(100);

  /// The part of `lacking` that is to be requested now, within the limits of one message; it is
  /// recorded as requested. Acknowledgements and plans pass unchanged.
  Control due(Control lacking, TimePoint now);

  /// The node was restarted: everything may be requested again at once.
  void begin_afresh();
  /// Removes the timers of streams that no longer exist.
  template <typename IsGone>
  void forget_streams(IsGone is_gone) {
    std::erase_if(key_frames_, [&](const auto& item) { return is_gone(item.first); });
  }

 private:
  std::map<StreamId, TimePoint> key_frames_;  ///< time of the last request, by stream
  std::optional<TimePoint> head_, chunks_;
};

}  // namespace mr::codec
