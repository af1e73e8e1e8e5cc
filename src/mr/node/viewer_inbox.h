#pragma once

#include <cstddef>
#include <map>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "mr/net/web_server.h"

namespace mr::node {

/// What viewers did and nobody looked at yet, in order. Bounded for each viewer: one that sends
/// more than can be looked at has nothing taken from it any more but that it floods. So none can
/// crowd out the words of others. Thread-safe.
class ViewerInbox {
 public:
  struct Event {
    enum class Kind { opened, closed, binary, text, flood } kind;
    net::ClientId viewer;
    std::vector<std::byte> bytes;  // of binary and text
  };

  static constexpr std::size_t kMostMessages = 64;  ///< of one viewer
  static constexpr std::size_t kMostBytes = 256u << 10;

  void add(Event::Kind kind, net::ClientId viewer, std::span<const std::byte> bytes = {}) {
    const std::lock_guard lock(mutex_);
    if (kind == Event::Kind::binary || kind == Event::Kind::text) {
      Waiting& of = waiting_[viewer];
      if (of.floods) return;
      ++of.messages, of.bytes += bytes.size();
      of.floods = of.messages > kMostMessages || of.bytes > kMostBytes;
      if (of.floods) kind = Event::Kind::flood, bytes = {};
    }
    events_.push_back({kind, viewer, {bytes.begin(), bytes.end()}});
  }

  std::vector<Event> take() {
    const std::lock_guard lock(mutex_);
    waiting_.clear();
    return std::exchange(events_, {});
  }

 private:
  struct Waiting {
    std::size_t messages = 0, bytes = 0;
    bool floods = false;
  };
  std::mutex mutex_;
  std::vector<Event> events_;
  std::map<net::ClientId, Waiting> waiting_;  // among events_
};

}  // namespace mr::node
