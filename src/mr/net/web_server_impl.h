#pragma once

#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "mr/net/connection_quota.h"
#include "mr/net/drops.h"
#include "mr/net/io_thread.h"
#include "mr/net/web_server.h"
#include "mr/net/web_socket.h"

namespace mr::net {

/// Whether a host name or address is one of loopback.
bool is_loopback_name(const std::string& host);

/// The state of a WebServer, shared by its sessions (http_session.cpp) and WebSockets. Used on the
/// io thread, unless said otherwise.
struct WebServer::Impl {
  explicit Impl(const WebConfig& c)
      : config(c),
        beyond_loopback(!is_loopback(c.listen)),
        thread(nullptr),
        acceptor(thread.io()),
        accept_timer(thread.io()),
        connections({c.connections, c.connections_per_address}),
        client_slots({c.clients, c.clients_per_address}) {}
  ~Impl() { thread.stop(); }

  Status listen();
  void accept();
  /// Starts a session on a new connection (http_session.cpp).
  void accepted(boost::asio::ip::tcp::socket socket);
  /// False: there is no slot for the client.
  bool upgrade(WebStream& stream, std::shared_ptr<ConnectionQuota::Slot> connection,
               const WebSocket::Request& request, const Visitor& visitor);
  /// Runs on the io thread when the client is still there.
  template <typename F>
  void with_client(ViewerId id, F function) {
    boost::asio::post(thread.io(), [this, id, function = std::move(function)]() mutable {
      const auto at = clients.find(id);
      if (at != clients.end()) function(*std::shared_ptr(at->second));
    });
  }

  const WebConfig config;
  const bool beyond_loopback;
  WebPages pages;
  ViewerEvents events;
  Drops drops;
  std::atomic<std::uint64_t> sent_bytes = 0;
  std::unique_ptr<boost::asio::ssl::context> tls;  // null: plain
  IoThread thread;                                 // before its users
  boost::asio::ip::tcp::acceptor acceptor;
  boost::asio::steady_timer accept_timer;
  ConnectionQuota connections, client_slots;
  std::map<ViewerId, std::shared_ptr<WebSocket>> clients;
  int port = 0;
};

}  // namespace mr::net
