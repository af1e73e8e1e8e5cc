#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>

#include "mr/net/outbox.h"

namespace mr::net {

/// A viewer of this process; no two of any transport have the same.
using ViewerId = std::uint64_t;
inline ViewerId next_viewer_id() {
  static std::atomic<ViewerId> last = 0;
  return ++last;
}

/// Who asks for something.
struct Visitor {
  std::string address;  ///< without port; of IPv6 its network
  std::string token;    ///< that it showed when it came; may be empty
};

/// What a viewer transport tells. All run on a thread of the transport and must not wait or throw.
struct ViewerEvents {
  std::function<void(ViewerId, const Visitor&)> opened;
  /// False: the viewer is cut off at once, whatever else it has sent.
  std::function<bool(ViewerId, std::span<const std::byte>, bool is_text)> received;
  /// One binary message that was given to send() has left as a whole: there is room for another.
  std::function<void(ViewerId)> writable;
  std::function<void(ViewerId)> closed;
};

/// How viewers are reached: WebSocket (WebServer), or another way. It carries messages whole and in
/// their order, tells its ViewerEvents, and never looks inside. The caller bounds what it sends: a
/// viewer gets the next message when the last ones were written. Thread-safe.
class ViewerTransport {
 public:
  virtual ~ViewerTransport() = default;

  /// Lets viewers in, and tells of them from now on. Once.
  virtual void run(ViewerEvents events) = 0;
  /// Queues a binary message. A viewer that is gone is ignored, here and below.
  virtual void send(ViewerId viewer, Message message) = 0;
  virtual void send_text(ViewerId viewer, const std::string& text) = 0;
  /// Closes with a reason that the viewer sees, after the message that is on its way.
  virtual void close(ViewerId viewer, const std::string& reason) = 0;
  /// Ends a viewer that would not read why, at once.
  virtual void cut(ViewerId viewer) = 0;
  /// The viewer is what it should be: its place is not given to others any more.
  virtual void pin(ViewerId viewer) = 0;
  /// What was refused or cut off, by "<side>: <cause>".
  virtual std::map<std::string, std::uint64_t> drops() const = 0;
  /// Bytes of messages that left so far.
  virtual std::uint64_t sent_bytes() const = 0;
};

}  // namespace mr::net
