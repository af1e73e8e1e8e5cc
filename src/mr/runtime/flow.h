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

/// A bounded queue of capacity one between a node's two pipeline stages. put() blocks until the
/// last value was taken (back-pressure), so a first stage that is faster waits, and frames are
/// dropped before any work is spent on them.
template <typename T>
class Handoff {
 public:
  /// Blocks; false when stop was requested.
  bool put(const std::stop_token& stop, T value) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [&] { return !value_; });
    if (stop.stop_requested()) return false;
    value_ = std::move(value);
    changed_.notify_all();
    return true;
  }
  /// Blocks; nothing when stop was requested.
  std::optional<T> take(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [&] { return value_.has_value(); });
    if (stop.stop_requested()) return std::nullopt;  // even if a value is waiting
    auto value = std::exchange(value_, std::nullopt);
    changed_.notify_all();
    return value;
  }

 private:
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::optional<T> value_;
};

/// An auto-reset event: wakes one thread that waits for several conditions.
class Signal {
 public:
  void notify() {
    {
      const std::lock_guard lock(mutex_);
      raised_ = true;
    }
    changed_.notify_all();
  }
  /// Returns once notified, after `longest`, or when stop is requested.
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

/// Credit-based flow control: keeps a producer from running ahead of its consumers, so that frames
/// are dropped before any work is spent on them. The producer may begin a packet if fewer than
/// `ahead` of its packets are begun and not yet acknowledged by any consumer; without an
/// acknowledgement, after `kPatience`. No clock inside. Thread-safe.
class Credit {
 public:
  static constexpr Duration kPatience = std::chrono::milliseconds(500);

  explicit Credit(int ahead) : ahead_(static_cast<std::uint64_t>(ahead)) {}

  /// Begins a packet; false: no credit.
  bool try_begin(TimePoint now) {
    const std::lock_guard lock(mutex_);
    if (working_ >= ahead_) return false;
    const bool may_begin = working_ + published_ - taken_ < ahead_;
    if (!may_begin && !is_due(begun_ ? begun_ : std::optional(now), kPatience, now)) return false;
    ++working_;
    begun_ = now;
    return true;
  }
  /// A packet that was begun is published, or abandoned.
  void end(bool published) {
    const std::lock_guard lock(mutex_);
    --working_;
    if (published) ++published_;
  }
  /// A consumer acknowledged the packet with this sequence.
  void taken(std::uint64_t sequence) {
    const std::lock_guard lock(mutex_);
    if (sequence >= published_) return;  // of another epoch
    taken_ = std::max(taken_, sequence + 1);
  }

 private:
  const std::uint64_t ahead_;
  std::mutex mutex_;
  std::uint64_t working_ = 0, published_ = 0, taken_ = 0;
  std::optional<TimePoint> begun_;  ///< time of the newest packet begun
};

}  // namespace mr::runtime
