#pragma once

#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <deque>
#include <memory>
#include <string>

#include "mr/net/drops.h"
#include "mr/net/web_server.h"

namespace mr::net {

/// One WebSocket client. Everything runs on the io thread. Messages go out in pieces, so that a
/// slow socket can be told from one that takes nothing.
class WebSocket : public std::enable_shared_from_this<WebSocket> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::empty_body>;

  /// `connection` is kept as long as the socket is. `handlers`, config and drops outlive it;
  /// `handlers.closed` is called exactly once, whether it opened or not.
  WebSocket(boost::beast::tcp_stream stream, std::shared_ptr<void> connection, ClientId id,
            const WebConfig& config, const WebHandlers& handlers, Drops& drops);

  void accept(const Request& request);
  void send(Message message, bool is_text);
  void close(const std::string& reason);
  /// Whether `handlers.opened` was told of it.
  bool opened() const { return open_; }

 private:
  struct Outgoing {
    Message message;
    bool is_text = false;
  };

  void read();
  void on_read();
  void write();
  void on_written(std::size_t bytes);
  void expect_progress();
  void cut(const std::string& cause);
  void ended();
  void say_goodbye();

  boost::beast::websocket::stream<boost::beast::tcp_stream> socket_;
  std::shared_ptr<void> connection_;
  const ClientId id_;
  const WebConfig& config_;
  const WebHandlers& handlers_;
  Drops& drops_;
  boost::asio::steady_timer stall_timer_;
  boost::beast::flat_buffer incoming_;
  std::deque<Outgoing> outgoing_;
  std::size_t queued_bytes_ = 0;
  std::size_t offset_ = 0;  ///< sent of the first of outgoing_
  std::string reason_;      ///< to close with, once closing_
  bool open_ = false, writing_ = false, closing_ = false, ended_ = false;
};

}  // namespace mr::net
