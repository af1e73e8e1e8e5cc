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
#include "mr/net/viewer_transport.h"

namespace mr::net {

/// A Visitor's token is read from this cookie, or from "Authorization: Bearer".
inline constexpr const char* kTokenCookie = "meshreduce_token";

/// A page generated on request.
struct WebPage {
  int status = 200;
  std::string mime = "text/plain; charset=utf-8";
  std::string text;
};

/// Generates pages for paths without a file. Runs on the server's thread; must not wait or throw.
using WebPages =
    std::function<std::optional<WebPage>(const std::string& path, const Visitor& visitor)>;

struct WebConfig {
  std::string listen = "127.0.0.1:8080";  ///< host:port; port 0: any free port
  std::filesystem::path root = {};        ///< folder of the built page; empty: none
  /// Accepted values of the Host header; others get 421. This prevents DNS rebinding, by which a
  /// page of another site could read everything. Empty: the names of loopback and, when the server
  /// listens on other interfaces, the local address of the connection.
  std::vector<std::string> hosts = {};
  std::optional<Certificate> certificate = {};  ///< set: HTTPS only, with this certificate
  int clients = 64;                             ///< WebSockets at once; further ones get 503
  int clients_per_address = 16;                 ///< ... of one address
  int connections = 256;             ///< in all; a new one evicts the oldest without a WebSocket
  int connections_per_address = 48;  ///< ... of one address
  std::size_t message_bytes = 1u << 20;  ///< largest that a client may send
  std::size_t queue_bytes = 64u << 20;   ///< waiting for one client; above it, it is disconnected
  std::chrono::seconds stalled{10};  ///< a client that accepts no byte for so long is disconnected
  std::chrono::seconds patience{5};  ///< limit of a TLS handshake, a request, a WebSocket handshake
  std::chrono::seconds idle{10};     ///< for the next request on a connection
};

/// An HTTP(S) server for the web page and for viewers, whose WebSocket is at /stream. Runs one
/// thread until it is destroyed; `closed` is not called for viewers still connected then.
/// Browsers are accepted only from pages of this server: Origin must match Host (against cross-site
/// WebSocket hijacking).
class WebServer final : public ViewerTransport {
 public:
  /// Binds and listens; connections wait until run(). io: the address cannot be bound; the message
  /// says what to do. invalid: the address is malformed, or the certificate cannot be used.
  static Result<std::unique_ptr<WebServer>> listen(const WebConfig& config, WebPages pages = {});
  ~WebServer() override;

  int port() const;
  void run(ViewerEvents events) override;
  void send(ViewerId viewer, Message message) override;
  void send_text(ViewerId viewer, const std::string& text) override;
  /// Sends at most 123 bytes of the reason (RFC 6455) and disconnects within two seconds.
  void close(ViewerId viewer, const std::string& reason) override;
  void cut(ViewerId viewer) override;
  void pin(ViewerId viewer) override;
  std::map<std::string, std::uint64_t> drops() const override;
  std::uint64_t sent_bytes() const override;

 private:
  friend class HttpSession;
  struct Impl;
  explicit WebServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Whether an address such as "127.0.0.1:8080" can be reached from this machine only.
bool is_loopback(const std::string& listen);

}  // namespace mr::net
