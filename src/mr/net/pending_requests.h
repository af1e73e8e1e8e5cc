#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "mr/net/transport.h"

namespace mr::net {

/// Requests that are waiting to be sent or to be answered. A request times out after kPatience, and
/// there are at most kMost. Thread-safe.
class PendingRequests {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  using OnAnswer = std::function<void(Message)>;
  struct Request {
    std::uint64_t id = 0;
    Message message;
    bool wants_answer = false;
  };

  static constexpr std::chrono::seconds kPatience{2};
  static constexpr std::size_t kMost = 1024;

  /// Adds a request and returns its id, which its answer carries; 0: kMost are waiting already.
  std::uint64_t add(TimePoint now, Message request, OnAnswer on_answer) {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= kMost) return 0;
    waiting_[++last_] = {now + kPatience, std::move(request), std::move(on_answer)};
    return last_;
  }

  /// Removes a request whose answer arrived and returns its callback; empty when it has timed out.
  OnAnswer take(std::uint64_t id) {
    const std::lock_guard lock(mutex_);
    auto node = waiting_.extract(id);
    return node.empty() ? OnAnswer() : std::move(node.mapped().on_answer);
  }

  /// Removes requests that timed out; returns how many of them wanted an answer.
  std::size_t expire(TimePoint now) {
    std::map<std::uint64_t, Waiting> late;  // destroyed after the lock is released
    const std::lock_guard lock(mutex_);
    while (!waiting_.empty() && waiting_.begin()->second.until <= now)
      late.insert(waiting_.extract(waiting_.begin()));
    return static_cast<std::size_t>(std::count_if(late.begin(), late.end(), [](const auto& item) {
      return item.second.on_answer != nullptr;
    }));
  }

  /// The oldest waiting request with an id above `id`. A request that wants no answer
  /// is removed.
  std::optional<Request> next_after(std::uint64_t id) {
    const std::lock_guard lock(mutex_);
    const auto at = waiting_.upper_bound(id);
    if (at == waiting_.end()) return std::nullopt;
    Request next{at->first, at->second.request, at->second.on_answer != nullptr};
    if (!next.wants_answer) waiting_.erase(at);
    return next;
  }

  bool empty() const {
    const std::lock_guard lock(mutex_);
    return waiting_.empty();
  }

 private:
  struct Waiting {
    TimePoint until;
    Message request;
    OnAnswer on_answer;
  };
  mutable std::mutex mutex_;
  std::uint64_t last_ = 0;
  std::map<std::uint64_t, Waiting> waiting_;  ///< ids grow with time, so the oldest is first
};

}  // namespace mr::net
