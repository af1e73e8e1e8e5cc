#pragma once

#include <algorithm>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "mr/net/transport.h"

namespace mr::net {

/// A callback that can be cancelled from any thread: once end() returns, no call of it is running,
/// except a call that called end() itself.
template <typename Signature>
class CancellableCallback;

template <typename R, typename... A>
class CancellableCallback<R(A...)> {
 public:
  explicit CancellableCallback(std::function<R(A...)> function) : function_(std::move(function)) {}

  /// Calls the function; returns R() once it was cancelled.
  R operator()(A... arguments) {
    const RunningCall inside(*this);
    if (!inside.open) return R();
    return function_(std::forward<A>(arguments)...);
  }

  void end() {
    const auto self = std::this_thread::get_id();
    std::unique_lock lock(mutex_);
    ended_ = true;
    left_.wait(lock, [&] {
      return std::all_of(running_.begin(), running_.end(), [&](auto id) { return id == self; });
    });
  }

 private:
  struct RunningCall {
    explicit RunningCall(CancellableCallback& g) : guarded(g) {
      const std::lock_guard lock(guarded.mutex_);
      open = !guarded.ended_;
      if (open) guarded.running_.push_back(std::this_thread::get_id());
    }
    ~RunningCall() {
      if (!open) return;
      const std::lock_guard lock(guarded.mutex_);
      auto& running = guarded.running_;
      running.erase(std::find(running.begin(), running.end(), std::this_thread::get_id()));
      guarded.left_.notify_all();
    }
    RunningCall(const RunningCall&) = delete;
    RunningCall& operator=(const RunningCall&) = delete;

    CancellableCallback& guarded;
    bool open = false;
  };

  const std::function<R(A...)> function_;
  std::mutex mutex_;
  std::condition_variable left_;
  std::vector<std::thread::id> running_;
  bool ended_ = false;
};

/// The callbacks registered for each node, by its name. Thread-safe. A Subscription removes its
/// callback when destroyed, and may outlive the registry.
template <typename Signature>
class Registry {
 public:
  using Callback = CancellableCallback<Signature>;

  std::unique_ptr<Subscription> add(const std::string& node, std::function<Signature> function) {
    auto callback = std::make_shared<Callback>(std::move(function));
    const std::lock_guard lock(state_->mutex);
    state_->callbacks[node].push_back(callback);
    return std::make_unique<Entry>(state_, node, std::move(callback));
  }

  /// The callbacks of a node in the order in which they were added.
  std::vector<std::shared_ptr<Callback>> of(const std::string& node) const {
    const std::lock_guard lock(state_->mutex);
    const auto at = state_->callbacks.find(node);
    return at == state_->callbacks.end() ? std::vector<std::shared_ptr<Callback>>() : at->second;
  }

  bool has(const std::string& node) const {
    const std::lock_guard lock(state_->mutex);
    return state_->callbacks.contains(node);
  }

 private:
  struct State {
    std::mutex mutex;
    std::map<std::string, std::vector<std::shared_ptr<Callback>>> callbacks;
  };

  class Entry final : public Subscription {
   public:
    Entry(std::shared_ptr<State> state, std::string node, std::shared_ptr<Callback> callback)
        : state_(std::move(state)), node_(std::move(node)), callback_(std::move(callback)) {}
    Entry(const Entry&) = delete;
    Entry& operator=(const Entry&) = delete;
    ~Entry() override {
      {
        const std::lock_guard lock(state_->mutex);
        const auto at = state_->callbacks.find(node_);
        std::erase(at->second, callback_);
        if (at->second.empty()) state_->callbacks.erase(at);
      }
      callback_->end();
    }

   private:
    std::shared_ptr<State> state_;
    std::string node_;
    std::shared_ptr<Callback> callback_;
  };

  std::shared_ptr<State> state_ = std::make_shared<State>();
};

using PacketRegistry = Registry<void(Message)>;
using AnswerRegistry = Registry<Message(std::span<const std::byte>)>;

/// The answer of the newest service of `node`; null when there is none.
inline Message answer_from(const AnswerRegistry& registry, const std::string& node,
                           std::span<const std::byte> request) {
  const auto serving = registry.of(node);
  return serving.empty() ? nullptr : (*serving.back())(request);
}

}  // namespace mr::net
