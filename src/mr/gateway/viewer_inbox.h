#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "mr/core/frame.h"
#include "mr/net/viewer_transport.h"
#include "mr/node/token_bucket.h"

namespace mr::gateway {

/// Queue of the viewers' events that the gateway has not handled yet, in order of arrival. Each
/// viewer has a limit of waiting messages and bytes and a rate limit, so that one viewer cannot
/// crowd out the others: a viewer that exceeds a limit is flooding and must be cut off.
/// Thread-safe.
class ViewerInbox {
 public:
  struct Event {
    enum class Kind { opened, closed, binary, text, written } kind;
    net::ViewerId viewer;
    std::vector<std::byte> bytes = {};          ///< of binary and text
    net::ViewerTransport* transport = nullptr;  ///< of opened
    net::Visitor visitor = {};                  ///< of opened
    std::size_t messages = 1;                   ///< of written
  };

  static constexpr std::size_t kMostMessages = 64;  ///< of one viewer, waiting
  static constexpr std::size_t kMostBytes = 256u << 10;
  static constexpr double kMostPerSecond = 200, kBurst = 400;  ///< messages of one viewer

  /// `wake` is called after each event, on any thread. To be set before the first event.
  void wake_by(std::function<void()> wake) { wake_ = std::move(wake); }

  void opened(net::ViewerId viewer, net::ViewerTransport& transport, const net::Visitor& visitor) {
    add({Event::Kind::opened, viewer, {}, &transport, visitor});
  }
  void closed(net::ViewerId viewer) {
    {
      const std::lock_guard lock(mutex_);
      senders_.erase(viewer);
    }
    add({Event::Kind::closed, viewer});
  }
  /// One more message was written to the viewer's socket.
  void written(net::ViewerId viewer) {
    {
      const std::lock_guard lock(mutex_);
      const bool follows = !events_.empty() && events_.back().kind == Event::Kind::written &&
                           events_.back().viewer == viewer;
      if (follows) {
        ++events_.back().messages;
        return;
      }
    }
    add({Event::Kind::written, viewer});
  }
  /// False: the viewer is flooding; this and all its later messages are dropped.
  bool received(net::ViewerId viewer, std::span<const std::byte> bytes, bool is_text,
                TimePoint now) {
    {
      const std::lock_guard lock(mutex_);
      Sender& sender = senders_[viewer];
      ++sender.messages, sender.bytes += bytes.size();
      sender.floods |= sender.messages > kMostMessages || sender.bytes > kMostBytes ||
                       sender.allowance.left(now) < 1;
      sender.allowance.spend(1);
      if (sender.floods) return false;
    }
    const auto kind = is_text ? Event::Kind::text : Event::Kind::binary;
    add({kind, viewer, {bytes.begin(), bytes.end()}});
    return true;
  }

  std::vector<Event> take() {
    const std::lock_guard lock(mutex_);
    for (auto& [viewer, sender] : senders_) sender.messages = sender.bytes = 0;
    return std::exchange(events_, {});
  }

 private:
  struct Sender {
    std::size_t messages = 0, bytes = 0;  ///< waiting
    node::TokenBucket allowance{kMostPerSecond, kBurst};
    bool floods = false;
  };
  void add(Event event) {
    {
      const std::lock_guard lock(mutex_);
      events_.push_back(std::move(event));
    }
    if (wake_) wake_();
  }

  std::function<void()> wake_;
  std::mutex mutex_;
  std::vector<Event> events_;
  std::map<net::ViewerId, Sender> senders_;
};

}  // namespace mr::gateway
