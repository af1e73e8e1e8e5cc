#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <stop_token>
#include <vector>

namespace mr::net {

/// Bytes that many receivers may share.
using Message = std::shared_ptr<const std::vector<std::byte>>;

/// Folds messages that wait for one slow receiver into one (DESIGN section 4, Queues). Takes them
/// oldest first, at least one; null when they cannot be folded, they are then lost. Called on
/// several threads at once; must not throw.
using Coalesce = std::function<Message(std::span<const Message>)>;

struct OutboxLimits {
  std::size_t messages = 30;       ///< waiting; one more and they are folded into one
  std::size_t bytes = 128u << 20;  ///< waiting; above it all but the newest are lost
};

/// The bounded, coalescing queue in front of ONE slow receiver: a socket, a node's worker, a
/// viewer. What waits is folded into one message when it is taken, or when there is too much of it.
/// Any number of threads may push, one takes.
class Outbox {
 public:
  struct Counts {
    std::uint64_t folded = 0;  ///< messages that went on inside another one
    std::uint64_t lost = 0;    ///< messages that went nowhere; the receiver sees a gap
  };

  /// Without `coalesce` messages are taken one by one, and all that wait are lost when there are
  /// too many.
  explicit Outbox(Coalesce coalesce, const OutboxLimits& limits = {});

  /// True when nothing waited before, that is when the receiver may have to be woken. A message
  /// that alone exceeds the cap is lost; null is ignored.
  bool push(Message message);

  /// Everything that waits as one message; null when nothing does, or when it could not be folded.
  Message try_pop();

  /// Waits for a message; null once stop is asked for.
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
  std::size_t bytes_ = 0;         ///< of all that wait
  Counts counts_;
};

}  // namespace mr::net
