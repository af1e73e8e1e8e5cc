#include "mr/net/web_socket.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
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
constexpr std::chrono::seconds kCloseTimeout{2};
constexpr std::size_t kMostQueued = 256;  // messages, small ones too
constexpr int kMostPings = 100, kMostLateReads = 64;

}  // namespace

WebSocket::WebSocket(WebStream stream, std::shared_ptr<ConnectionQuota::Slot> connection,
                     ViewerId id, const Shared& shared)
    : socket_(std::move(stream)),
      connection_(std::move(connection)),
      id_(id),
      shared_(shared),
      stall_timer_(socket_.get_executor()),
      close_timer_(socket_.get_executor()) {}

void WebSocket::accept(const Request& request, const Visitor& visitor) {
  socket_.next_layer().tcp().expires_never();  // Beast's WebSocket has its own timeouts
  socket_.set_option(websocket::stream_base::timeout{shared_.config.patience, kPing, true});
  socket_.read_message_max(shared_.config.message_bytes);
  socket_.auto_fragment(false);
  watch_pings();
  socket_.async_accept(request, [self = shared_from_this(), visitor](const auto& error) {
    if (error) return self->ended();
    self->open_ = true;
    if (self->shared_.events.opened) self->shared_.events.opened(self->id_, visitor);
    self->read();
  });
}

/// Limits pings: the library answers them itself, without a limit.
void WebSocket::watch_pings() {
  socket_.control_callback(
      [weak = weak_from_this()](websocket::frame_type kind, beast::string_view) {
        const auto self = weak.lock();
        if (!self || kind != websocket::frame_type::ping || ++self->pings_ != kMostPings) return;
        boost::asio::post(self->socket_.get_executor(), [self] { self->cut("too many pings"); });
      });
}

void WebSocket::read() {
  socket_.async_read(incoming_, [self = shared_from_this()](const auto& error, std::size_t) {
    if (error == websocket::error::message_too_big || error == websocket::error::buffer_overflow)
      self->shared_.drops.count("client", "message too large");
    if (error == beast::error::timeout) self->shared_.drops.count("client", "silent");
    if (error) return self->ended();
    self->on_read();
  });
}

void WebSocket::on_read() {
  const auto data = incoming_.cdata();
  const std::span bytes(static_cast<const std::byte*>(data.data()), data.size());
  pings_ = 0;
  const auto& received = shared_.events.received;
  const bool goes_on = !received || closing_ || received(id_, bytes, socket_.got_text());
  incoming_.consume(incoming_.size());
  if (!goes_on) return cut("too many messages at once");
  if (!ended_) read();
}

void WebSocket::send(Message message, bool is_text) {
  if (!open_ || closing_ || ended_ || !message) return;
  queued_bytes_ += message->size();
  if (queued_bytes_ > shared_.config.queue_bytes || outgoing_.size() >= kMostQueued)
    return cut("too much waits for it");
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
  shared_.sent_bytes += bytes;
  if (offset_ == outgoing_.front().message->size()) {
    const bool is_text = outgoing_.front().is_text;
    queued_bytes_ -= offset_;
    offset_ = 0;
    outgoing_.pop_front();
    if (!is_text && shared_.events.writable) shared_.events.writable(id_);
  }
  if (!outgoing_.empty()) return write();
  if (closing_) send_close_frame();
}

void WebSocket::expect_progress() {
  stall_timer_.expires_after(shared_.config.stalled);
  stall_timer_.async_wait([weak = weak_from_this()](const auto& error) {
    const auto self = weak.lock();
    if (self && !error && self->writing_) self->cut("takes nothing");
  });
}

void WebSocket::close(const std::string& reason) {
  if (!open_ || ended_ || std::exchange(closing_, true)) return;
  reason_ = reason.substr(0, kReasonBytes);
  socket_.next_layer().read_at_most(kMostLateReads);
  if (writing_) outgoing_.erase(outgoing_.begin() + 1, outgoing_.end());
  close_timer_.expires_after(kCloseTimeout);
  close_timer_.async_wait([weak = weak_from_this()](const auto& error) {
    const auto self = weak.lock();
    if (self && !error) self->ended();
  });
  if (!writing_) send_close_frame();
}

void WebSocket::send_close_frame() {
  const websocket::close_reason why(websocket::close_code::policy_error, reason_);
  socket_.async_close(why, [self = shared_from_this()](const auto&) { self->ended(); });
}

void WebSocket::cut(const std::string& cause) {
  if (ended_) return;
  shared_.drops.count("client", cause);
  ended();
}

void WebSocket::ended() {
  if (std::exchange(ended_, true)) return;
  stall_timer_.cancel();
  close_timer_.cancel();
  socket_.next_layer().tcp().close();
  if (writing_)  // the first one is being sent
    outgoing_.erase(outgoing_.begin() + 1, outgoing_.end());
  else
    outgoing_.clear();
  connection_.reset();
  slot_.reset();
  if (shared_.events.closed) shared_.events.closed(id_);
}

}  // namespace mr::net
