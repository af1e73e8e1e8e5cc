#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "mr/core/result.h"
#include "mr/net/outbox.h"

namespace mr::net {

using ClientId = std::uint64_t;

/// What a web server tells. All run on its one thread and must not wait or throw. None runs once
/// the server is destroyed; `closed` is not told of clients that are left then.
struct WebHandlers {
  std::function<void(ClientId)> opened;
  std::function<void(ClientId, std::span<const std::byte>, bool is_text)> received;
  /// All that was given to send() went to the socket.
  std::function<void(ClientId)> drained;
  std::function<void(ClientId)> closed;
};

struct WebConfig {
  std::string listen = "127.0.0.1:8080";  ///< host:port; port 0: any free one
  std::filesystem::path root = {};        ///< folder of the built page
  int clients = 64;                       ///< WebSockets at once; more are told 503
  int connections = 256;                  ///< all at once; more are closed at once
  std::size_t message_bytes = 1u << 20;   ///< largest that a client may send
  std::size_t queue_bytes = 64u << 20;    ///< waiting for one client; above it, it is cut off
  std::chrono::seconds stalled{10};   ///< a client whose socket takes nothing so long is cut off
  std::chrono::seconds patience{10};  ///< for a whole request, a handshake, the next request
};

/// HTTP for the page, WebSocket at /stream. Runs its own thread. A browser is let in only from a
/// page of this server (its Origin names our Host).
class WebServer {
 public:
  /// io: the address cannot be listened on; the message says what to do. invalid: it cannot be
  /// read.
  static Result<std::unique_ptr<WebServer>> start(const WebConfig& config, WebHandlers handlers);
  ~WebServer();

  int port() const;
  /// Queues a message; the caller keeps count, and waits for `drained` before it sends much more.
  /// A client that is gone is ignored.
  void send(ClientId client, Message message);
  void send_text(ClientId client, const std::string& text);
  /// Closes with a reason that the client sees (123 bytes of it at most), after what is queued.
  void close(ClientId client, const std::string& reason);
  /// What was refused or cut off, by "<side>: <cause>".
  std::map<std::string, std::uint64_t> drops() const;

 private:
  struct Impl;
  explicit WebServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::net
