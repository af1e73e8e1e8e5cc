#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/net/certificate.h"
#include "mr/net/outbox.h"

namespace mr::net {

using ClientId = std::uint64_t;

/// Who asks for something.
struct WebVisitor {
  std::string address;  ///< without port; of IPv6 its network
  std::string token;    ///< from the cookie kTokenCookie or "Authorization: Bearer"; may be empty
};
inline constexpr const char* kTokenCookie = "meshreduce_token";

/// A page that is made when it is asked for.
struct WebPage {
  int status = 200;
  std::string mime = "text/plain; charset=utf-8";
  std::string text;
};

/// What a web server tells. All run on its one thread and must not wait or throw. None runs once
/// the server is destroyed; `closed` is not told of clients that are left then.
struct WebHandlers {
  std::function<void(ClientId, const WebVisitor&)> opened;
  /// False: the client is cut off at once, whatever else it has sent.
  std::function<bool(ClientId, std::span<const std::byte>, bool is_text)> received;
  /// One binary message that was given to send() went to the socket as a whole.
  std::function<void(ClientId)> written;
  std::function<void(ClientId)> closed;
  /// For paths that no file is served at. May be absent.
  std::function<std::optional<WebPage>(const std::string& path, const WebVisitor&)> page;
};

struct WebConfig {
  std::string listen = "127.0.0.1:8080";  ///< host:port; port 0: any free one
  std::filesystem::path root = {};        ///< folder of the built page; empty: none
  /// Names in Host that are answered; every other gets 421, or a page of any site whose name
  /// resolves here could read everything. Empty: those of loopback, and where the server listens
  /// beyond it, the address that the connection came in at.
  std::vector<std::string> hosts = {};
  std::optional<Certificate> certificate = {};  ///< TLS only, with it
  int clients = 64;                             ///< WebSockets at once; more are told 503
  int clients_per_address = 16;                 ///< ... of one address
  int connections = 256;                 ///< all at once; the oldest that is no client gives way
  int connections_per_address = 48;      ///< ... of one address
  std::size_t message_bytes = 1u << 20;  ///< largest that a client may send
  std::size_t queue_bytes = 64u << 20;   ///< waiting for one client; above it, it is cut off
  std::chrono::seconds stalled{10};      ///< a client whose socket takes nothing so long is cut off
  std::chrono::seconds patience{5};      ///< for TLS, for a whole request, for a handshake
  std::chrono::seconds idle{10};         ///< for the next request on a connection
};

/// HTTP for the page, WebSocket at /stream. Runs its own thread. A browser is let in only from a
/// page of this server (its Origin names our Host).
class WebServer {
 public:
  /// io: the address cannot be listened on; the message says what to do. invalid: it cannot be
  /// read, or the certificate cannot be used.
  static Result<std::unique_ptr<WebServer>> start(const WebConfig& config, WebHandlers handlers);
  ~WebServer();

  int port() const;
  /// Queues a message; the caller keeps count of what is `written`. A client that is gone is
  /// ignored.
  void send(ClientId client, Message message);
  void send_text(ClientId client, const std::string& text);
  /// Closes with a reason that the client sees (123 bytes of it at most) after the message that is
  /// on its way, within two seconds.
  void close(ClientId client, const std::string& reason);
  /// Ends a client that would not read why, at once.
  void cut(ClientId client);
  /// The client is what it should be: its place is not given to others any more.
  void keep(ClientId client);
  /// What was refused or cut off, by "<side>: <cause>".
  std::map<std::string, std::uint64_t> drops() const;
  /// Bytes of messages that went to sockets so far.
  std::uint64_t sent_bytes() const;

 private:
  friend class HttpSession;
  struct Impl;
  explicit WebServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Whether an address such as "127.0.0.1:8080" is reached from this machine alone.
bool is_loopback(const std::string& listen);

}  // namespace mr::net
