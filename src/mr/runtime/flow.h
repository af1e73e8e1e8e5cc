#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stop_token>
#include <utility>

#include "mr/core/frame.h"

namespace mr::runtime {

/// Hands values from the first half of a node to the second; holds one at most. put() waits while
/// the last one was not taken: a half that is ahead stands still, and what comes in meanwhile is
/// dropped where that costs nothing, before the work.
template <typename T>
class Handoff {
 public:
  /// False when stop was asked for.
  bool put(const std::stop_token& stop, T value) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [&] { return !value_; });
    if (stop.stop_requested()) return false;
    value_ = std::move(value);
    changed_.notify_all();
    return true;
  }
  /// Nothing when stop was asked for.
  std::optional<T> take(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [&] { return value_.has_value(); });
    if (stop.stop_requested()) return std::nullopt;  // also where there is one: more may follow
    auto value = std::exchange(value_, std::nullopt);
    changed_.notify_all();
    return value;
  }

 private:
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::optional<T> value_;
};

/// Wakes one thread that waits for several things.
class Signal {
 public:
  void notify() {
    {
      const std::lock_guard lock(mutex_);
      raised_ = true;
    }
    changed_.notify_all();
  }
  /// Returns once notified, after `longest`, or when stop is asked for.
  void wait(const std::stop_token& stop, std::chrono::nanoseconds longest) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, stop, longest, [&] { return raised_; });
    raised_ = false;
  }

 private:
  std::mutex mutex_;
  std::condition_variable_any changed_;
  bool raised_ = false;
};

/// Keeps a producer from running ahead of its consumers (credit-based flow control), so that frames
/// are dropped before they cost anything: it begins a packet when fewer than `ahead` of its packets
/// are begun and not yet taken by any consumer. Without word from a consumer it goes on after
/// `kPatience`. No clock inside. Thread-safe.
class Credit {
 public:
  static constexpr Duration kPatience = std::chrono::milliseconds(500);

  explicit Credit(int ahead) : ahead_(static_cast<std::uint64_t>(ahead)) {}

  /// Begins a packet; false when it is too early.
  bool try_begin(TimePoint now) {
    const std::lock_guard lock(mutex_);
    if (working_ >= ahead_) return false;
    const bool may_begin = working_ + published_ - taken_ < ahead_;
    if (!may_begin && !is_due(begun_ ? begun_ : std::optional(now), kPatience, now)) return false;
    ++working_;
    begun_ = now;
    return true;
  }
  /// What was begun was published, or came to nothing.
  void end(bool published) {
    const std::lock_guard lock(mutex_);
    --working_;
    if (published) ++published_;
  }
  /// A consumer made use of the packet with this sequence.
  void taken(std::uint64_t sequence) {
    const std::lock_guard lock(mutex_);
    if (sequence >= published_) return;  // of another epoch
    taken_ = std::max(taken_, sequence + 1);
  }

 private:
  const std::uint64_t ahead_;
  std::mutex mutex_;
  std::uint64_t working_ = 0, published_ = 0, taken_ = 0;
  std::optional<TimePoint> begun_;  ///< the newest
};

}  // namespace mr::runtime
