#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "mr/codec/control.h"
#include "mr/node/node_clock.h"
#include "mr/node/token_bucket.h"

namespace mr::node {

/// Rate limits for the requests to a node, over all requesters together: so requests cannot
/// overload it. Well-behaved receivers repeat requests that were refused. Thread-safe.
class RequestLimits {
 public:
  static constexpr Duration kKeyFrameEvery = std::chrono::milliseconds(250);  ///< of one stream
  static constexpr Duration kHeadEvery = std::chrono::milliseconds(250);
  static constexpr double kBytesPerSecond = 32e6, kBurstBytes = 64e6;  ///< of all answers together

  /// The part of a request that is served now; the refused rest is counted.
  codec::Control admit(codec::Control request, TimePoint now) {
    const std::lock_guard lock(mutex_);
    std::erase_if(request.key_frames, [&](StreamId stream) {
      if (!make_room_for(stream, now)) return true;
      return !take(key_frames_[stream], kKeyFrameEvery, now);
    });
    if (request.whole_head) request.whole_head = take(head_, kHeadEvery, now);
    if (!request.chunks.empty() && bytes_.left(now) <= 0) {
      request.chunks.clear();
      ++refused_;
    }
    return request;
  }
  void answered(std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    bytes_.spend(static_cast<double>(bytes));
  }
  /// Number of refused parts of requests.
  std::uint64_t refused() const {
    const std::lock_guard lock(mutex_);
    return refused_;
  }

 private:
  /// Bounds the map: removes entries that limit nothing any more. False: it is still full.
  bool make_room_for(StreamId stream, TimePoint now) {
    if (key_frames_.size() < codec::Control::kMaxStreams || key_frames_.contains(stream))
      return true;
    std::erase_if(key_frames_,
                  [&](const auto& item) { return is_due(item.second, kKeyFrameEvery, now); });
    const bool has_room = key_frames_.size() < codec::Control::kMaxStreams;
    if (!has_room) ++refused_;
    return has_room;
  }
  bool take(std::optional<TimePoint>& last, Duration every, TimePoint now) {
    const bool may = is_due(last, every, now);
    if (may)
      last = now;
    else
      ++refused_;
    return may;
  }
  mutable std::mutex mutex_;
  std::map<StreamId, std::optional<TimePoint>> key_frames_;  ///< by stream
  std::optional<TimePoint> head_;
  TokenBucket bytes_{kBytesPerSecond, kBurstBytes};
  std::uint64_t refused_ = 0;
};

}  // namespace mr::node
