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

/// Where a Visitor's token comes from: this cookie, or "Authorization: Bearer".
inline constexpr const char* kTokenCookie = "meshreduce_token";

/// A page that is made when it is asked for.
struct WebPage {
  int status = 200;
  std::string mime = "text/plain; charset=utf-8";
  std::string text;
};

/// Makes pages for paths that no file is served at. On the server's thread: must not wait or throw.
using WebPages =
    std::function<std::optional<WebPage>(const std::string& path, const Visitor& visitor)>;

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

/// HTTP for the page; the viewers' transport WebSocket at /stream. Runs its own thread, which ends
/// with it; viewers that are left then are not told as closed. A browser is let in only from a page
/// of this server (its Origin names our Host).
class WebServer final : public ViewerTransport {
 public:
  /// Listens; who connects waits until run(). io: the address cannot be listened on; the message
  /// says what to do. invalid: it cannot be read, or the certificate cannot be used.
  static Result<std::unique_ptr<WebServer>> listen(const WebConfig& config, WebPages pages = {});
  ~WebServer() override;

  int port() const;
  void run(ViewerEvents events) override;
  void send(ViewerId viewer, Message message) override;
  void send_text(ViewerId viewer, const std::string& text) override;
  /// 123 bytes of the reason at most; within two seconds.
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

/// Whether an address such as "127.0.0.1:8080" is reached from this machine alone.
bool is_loopback(const std::string& listen);

}  // namespace mr::net
