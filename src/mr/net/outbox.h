#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

namespace mr::net {

/// An immutable message, shared by its receivers without copying.
using Message = std::shared_ptr<const std::vector<std::byte>>;

inline Message as_message(std::vector<std::byte> bytes) {
  return std::make_shared<const std::vector<std::byte>>(std::move(bytes));
}

/// Folds the messages that wait for one slow receiver into a single one (docs/wire-format.md,
/// Folded packets). Its argument is oldest first and never empty. Null: the messages cannot be
/// coalesced and are lost. Called from several threads at once; must not throw.
using Coalesce = std::function<Message(std::span<const Message>)>;

struct OutboxLimits {
  std::size_t messages = 30;       ///< limit of waiting messages; above it they are coalesced
  std::size_t bytes = 128u << 20;  ///< limit of waiting bytes; above it all but the newest are lost
};

/// The bounded, coalescing queue in front of ONE slow receiver: a socket, a node's worker thread or
/// a viewer. Waiting messages are coalesced into one when they are popped, or when there are too
/// many. Multiple producers, one consumer.
class Outbox {
 public:
  struct Counts {
    std::uint64_t folded = 0;  ///< messages coalesced into another one
    std::uint64_t lost = 0;    ///< messages dropped; the receiver sees a gap
  };

  /// Without `coalesce` messages are popped one by one, and all waiting ones are dropped when there
  /// are too many.
  explicit Outbox(Coalesce coalesce, const OutboxLimits& limits = {});

  /// Returns whether the queue was empty before, that is, whether the receiver may have to be
  /// woken. A message larger than OutboxLimits::bytes is dropped; null is ignored.
  bool push(Message message);

  /// Pops all waiting messages as one; null: none is waiting, or they could not be coalesced.
  Message try_pop();

  /// Waits for a message; null once stop is requested.
  Message pop(const std::stop_token& stop);

  bool empty() const;
  Counts counts() const;

 private:
  void add(Message message);
  void lose_waiting();
  std::vector<Message> take();
  Message fold(const std::vector<Message>& messages, Counts& counts) const;
  Message take_one(std::unique_lock<std::mutex>& lock);

  const Coalesce coalesce_;
  const OutboxLimits limits_;
  mutable std::mutex mutex_;
  std::condition_variable_any arrived_;
  std::vector<Message> waiting_;  ///< oldest first
  std::size_t bytes_ = 0;         ///< of all waiting messages
  Counts counts_;
};

}  // namespace mr::net
