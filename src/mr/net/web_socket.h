#pragma once

#include <atomic>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <deque>
#include <memory>
#include <string>

#include "mr/net/connection_quota.h"
#include "mr/net/drops.h"
#include "mr/net/web_server.h"
#include "mr/net/web_stream.h"

namespace mr::net {

/// One WebSocket client. Everything runs on the io thread. Messages are sent in pieces, so that a
/// slow client can be told from a stalled one.
class WebSocket : public std::enable_shared_from_this<WebSocket> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::empty_body>;

  /// The server's state that all its WebSockets share; it outlives them.
  struct Shared {
    const WebConfig& config;
    const ViewerEvents& events;
    Drops& drops;
    std::atomic<std::uint64_t>& sent_bytes;
  };

  /// Keeps the slot `connection` until destroyed. Calls `events.closed` exactly once, even if it
  /// never opened.
  WebSocket(WebStream stream, std::shared_ptr<ConnectionQuota::Slot> connection, ViewerId id,
            const Shared& shared);

  /// Sets the slot in the quota of clients.
  void set_slot(std::shared_ptr<ConnectionQuota::Slot> slot) { slot_ = std::move(slot); }
  void pin() { slot_->pin(); }
  void accept(const Request& request, const Visitor& visitor);
  void send(Message message, bool is_text);
  /// Sends a close frame with the reason after the current message and drops all queued ones. The
  /// connection ends soon, whatever the client does.
  void close(const std::string& reason);
  /// Both disconnect at once; cut() counts `cause` as a drop.
  void ended();
  void cut(const std::string& cause);
  /// Whether `events.opened` was called.
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
  void watch_pings();
  void send_close_frame();

  boost::beast::websocket::stream<WebStream> socket_;
  std::shared_ptr<ConnectionQuota::Slot> connection_, slot_;
  const ViewerId id_;
  const Shared shared_;
  boost::asio::steady_timer stall_timer_, close_timer_;
  boost::beast::flat_buffer incoming_;
  std::deque<Outgoing> outgoing_;
  std::size_t queued_bytes_ = 0;
  std::size_t offset_ = 0;  ///< sent of the first of outgoing_
  std::string reason_;      ///< to close with, once closing_
  int pings_ = 0;           ///< pings since the client sent a message
  bool open_ = false, writing_ = false, closing_ = false, ended_ = false;
};

}  // namespace mr::net
