#include "mr/net/web_socket.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/beast/websocket/error.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <utility>

namespace mr::net {
namespace beast = boost::beast;
namespace websocket = beast::websocket;

namespace {

constexpr std::size_t kPieceBytes = 64u << 10;
constexpr std::size_t kReasonBytes = 123;  // RFC 6455, 5.5.1
constexpr std::chrono::seconds kPing{20};  // silence after which a client counts as gone

}  // namespace

WebSocket::WebSocket(beast::tcp_stream stream, std::shared_ptr<void> connection, ClientId id,
                     const WebConfig& config, const WebHandlers& handlers, Drops& drops)
    : socket_(std::move(stream)),
      connection_(std::move(connection)),
      id_(id),
      config_(config),
      handlers_(handlers),
      drops_(drops),
      stall_timer_(socket_.get_executor()) {}

void WebSocket::accept(const Request& request) {
  beast::get_lowest_layer(socket_).expires_never();  // the WebSocket has timeouts of its own
  socket_.set_option(websocket::stream_base::timeout{config_.patience, kPing, true});
  socket_.read_message_max(config_.message_bytes);
  socket_.auto_fragment(false);
  socket_.async_accept(request, [self = shared_from_this()](const auto& error) {
    if (error) return self->ended();
    self->open_ = true;
    if (self->handlers_.opened) self->handlers_.opened(self->id_);
    self->read();
  });
}

void WebSocket::read() {
  socket_.async_read(incoming_, [self = shared_from_this()](const auto& error, std::size_t) {
    if (error == websocket::error::message_too_big || error == websocket::error::buffer_overflow)
      self->drops_.count("client", "message too large");
    if (error == beast::error::timeout) self->drops_.count("client", "silent");
    if (error) return self->ended();
    self->on_read();
  });
}

void WebSocket::on_read() {
  const auto data = incoming_.cdata();
  const std::span bytes(static_cast<const std::byte*>(data.data()), data.size());
  if (handlers_.received) handlers_.received(id_, bytes, socket_.got_text());
  incoming_.consume(incoming_.size());
  if (!ended_) read();
}

void WebSocket::send(Message message, bool is_text) {
  if (!open_ || closing_ || ended_ || !message) return;
  queued_bytes_ += message->size();
  if (queued_bytes_ > config_.queue_bytes) return cut("too much waits for it");
  outgoing_.push_back({std::move(message), is_text});
  if (!writing_) write();
}

void WebSocket::write() {
  const Outgoing& front = outgoing_.front();
  const std::size_t size = std::min(kPieceBytes, front.message->size() - offset_);
  const bool last = offset_ + size == front.message->size();
  writing_ = true;
  if (offset_ == 0) socket_.text(front.is_text);
  expect_progress();
  const std::byte* from = front.message->data() + offset_;
  socket_.async_write_some(last, boost::asio::const_buffer(from, size),
                           [self = shared_from_this(), size](const auto& error, std::size_t) {
                             self->writing_ = false;
                             if (error)
                               self->ended();
                             else
                               self->on_written(size);
                           });
}

void WebSocket::on_written(std::size_t bytes) {
  stall_timer_.cancel();
  if (ended_) return;
  offset_ += bytes;
  if (offset_ == outgoing_.front().message->size()) {
    queued_bytes_ -= offset_;
    offset_ = 0;
    outgoing_.pop_front();
  }
  if (!outgoing_.empty()) return write();
  if (closing_) return say_goodbye();
  if (handlers_.drained) handlers_.drained(id_);
}

void WebSocket::expect_progress() {
  stall_timer_.expires_after(config_.stalled);
  stall_timer_.async_wait([weak = weak_from_this()](const auto& error) {
    const auto self = weak.lock();
    if (self && !error && self->writing_) self->cut("takes nothing");
  });
}

void WebSocket::close(const std::string& reason) {
  if (!open_ || ended_ || std::exchange(closing_, true)) return;
  reason_ = reason.substr(0, kReasonBytes);
  if (!writing_) say_goodbye();
}

void WebSocket::say_goodbye() {
  const websocket::close_reason why(websocket::close_code::normal, reason_);
  socket_.async_close(why, [self = shared_from_this()](const auto&) { self->ended(); });
}

void WebSocket::cut(const std::string& cause) {
  drops_.count("client", cause);
  ended();
}

void WebSocket::ended() {
  if (std::exchange(ended_, true)) return;
  stall_timer_.cancel();
  beast::get_lowest_layer(socket_).close();
  if (!writing_) outgoing_.clear();  // else the socket still reads from the first
  if (handlers_.closed) handlers_.closed(id_);
}

}  // namespace mr::net
