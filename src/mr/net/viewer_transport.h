#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>

#include "mr/net/outbox.h"

namespace mr::net {

/// Identifies a viewer, uniquely within this process over all transports.
using ViewerId = std::uint64_t;
inline ViewerId next_viewer_id() {
  static std::atomic<ViewerId> last = 0;
  return ++last;
}

/// The client behind a viewer or an HTTP request.
struct Visitor {
  std::string address;  ///< IP address without port; for IPv6 its /64 network
  std::string token;    ///< from its cookie or Authorization header; may be empty
};

/// Callbacks of a viewer transport. They run on its thread and must not wait or throw.
struct ViewerEvents {
  std::function<void(ViewerId, const Visitor&)> opened;
  /// A message from the viewer. False: disconnect it at once and ignore what else it has sent.
  std::function<bool(ViewerId, std::span<const std::byte>, bool is_text)> received;
  /// A binary message given to send() was written completely: another one may be sent.
  std::function<void(ViewerId)> writable;
  std::function<void(ViewerId)> closed;
};

/// Carries whole messages in order between this process and viewers, over WebSocket (WebServer) or
/// another protocol, without interpreting them. Flow control is the caller's: it sends a viewer
/// the next message when ViewerEvents::writable reports the last one. Thread-safe.
class ViewerTransport {
 public:
  virtual ~ViewerTransport() = default;

  /// Starts to accept viewers and to call `events`. To be called once.
  virtual void run(ViewerEvents events) = 0;
  /// Queues a binary message. Here and below, a viewer that is gone is ignored.
  virtual void send(ViewerId viewer, Message message) = 0;
  virtual void send_text(ViewerId viewer, const std::string& text) = 0;
  /// Closes the connection after the current message, with a reason that the viewer receives.
  virtual void close(ViewerId viewer, const std::string& reason) = 0;
  /// Disconnects a viewer at once, without a closing handshake.
  virtual void cut(ViewerId viewer) = 0;
  /// Protects a viewer's connection from eviction in favour of a new one.
  virtual void pin(ViewerId viewer) = 0;
  /// Counts of refused and disconnected peers, by "<side>: <cause>".
  virtual std::map<std::string, std::uint64_t> drops() const = 0;
  /// Bytes of messages sent so far.
  virtual std::uint64_t sent_bytes() const = 0;
};

}  // namespace mr::net
