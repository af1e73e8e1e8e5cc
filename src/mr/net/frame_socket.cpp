#include "mr/net/frame_socket.h"

#include <netinet/tcp.h>
#include <sys/socket.h>

#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/write.hpp>
#include <utility>

#include "mr/net/tcp_secret.h"

namespace mr::net {
namespace {

constexpr std::size_t kReadBytes = 256u << 10;
constexpr int kSendBufferBytes = 1 << 20;
constexpr int kPatienceMs = 6000;  // until a peer that reads nothing is disconnected
constexpr std::chrono::seconds kHandshakePatience{5};
constexpr std::chrono::seconds kRefusalPatience{1};

Error closed(const boost::system::error_code& error) {
  const bool is_end =
      error == boost::asio::error::eof || error == boost::asio::ssl::error::stream_truncated;
  return {Error::Cause::io, is_end ? "closed" : error.message()};
}

}  // namespace

void tune_socket(boost::asio::ip::tcp::socket& socket) {
  const auto set = [&](int level, int name, int value) {
    static_cast<void>(::setsockopt(socket.native_handle(), level, name, &value, sizeof value));
  };
  set(IPPROTO_TCP, TCP_NODELAY, 1);
  set(SOL_SOCKET, SO_SNDBUF, kSendBufferBytes);
  set(SOL_SOCKET, SO_KEEPALIVE, 1);
  set(IPPROTO_TCP, TCP_KEEPIDLE, 2);
  set(IPPROTO_TCP, TCP_KEEPINTVL, 1);
  set(IPPROTO_TCP, TCP_KEEPCNT, 4);
  set(IPPROTO_TCP, TCP_USER_TIMEOUT, kPatienceMs);
}

struct FrameSocket::Tls {
  boost::asio::ssl::stream<boost::asio::ip::tcp::socket&> stream;
};

FrameSocket::FrameSocket(boost::asio::ip::tcp::socket socket, Side side,
                         std::shared_ptr<TcpSecret> secret, FrameLimits limits, Handlers handlers)
    : socket_(std::move(socket)),
      side_(side),
      secret_(std::move(secret)),
      reader_(std::move(limits)),
      handlers_(std::make_shared<Handlers>(std::move(handlers))),
      timer_(socket_.get_executor()),
      buffer_(kReadBytes) {}

FrameSocket::~FrameSocket() = default;

void FrameSocket::start() {
  tune_socket(socket_);
  if (side_ == Side::listens) return read_first();
  if (!secret_) return open();
  tls_.reset(new Tls{{socket_, secret_->context()}});
  // A peer without the secret could offer a certificate instead; none is trusted.
  tls_->stream.set_verify_mode(boost::asio::ssl::verify_peer);
  end_in(kHandshakePatience, {Error::Cause::io, "no handshake in time"});
  tls_->stream.async_handshake(
      boost::asio::ssl::stream_base::client,
      [self = shared_from_this()](const auto& error) { self->on_handshake(error); });
}

/// Reads the first bytes, which show whether the peer uses TLS. The listening side has a deadline.
void FrameSocket::read_first() {
  boost::asio::async_read(socket_, boost::asio::buffer(buffer_, kFirstBytes),
                          [self = shared_from_this()](const auto& error, std::size_t bytes) {
                            if (error)
                              self->end(closed(error));
                            else if (self->handlers_)
                              self->on_first(bytes);
                          });
}

void FrameSocket::on_first(std::size_t bytes) {
  const bool encrypted = begins_tls(std::span(buffer_).first(bytes));
  if (encrypted && !secret_) return refuse({Error::Cause::invalid, kOnlyConnectingHasSecret});
  if (!encrypted && secret_) return refuse({Error::Cause::invalid, kOnlyListeningHasSecret});
  if (!encrypted) {
    open();
    return on_read(bytes);
  }
  tls_.reset(new Tls{{socket_, secret_->context()}});
  tls_->stream.async_handshake(
      boost::asio::ssl::stream_base::server, boost::asio::buffer(buffer_, bytes),
      [self = shared_from_this()](const auto& error, std::size_t) { self->on_handshake(error); });
}

void FrameSocket::on_handshake(const boost::system::error_code& error) {
  if (!handlers_) return;
  timer_.cancel();
  if (error) return end(side_ == Side::connects ? client_refusal(error) : server_refusal(error));
  open();
  if (handlers_) read();
}

void FrameSocket::open() {
  open_ = true;
  if (const auto handlers = handlers_; handlers && handlers->opened) handlers->opened();
  if (!tls_ && side_ == Side::connects) read();
  wake();
}

void FrameSocket::read() {
  const auto done = [self = shared_from_this()](const auto& error, std::size_t bytes) {
    if (error)
      self->end(self->refused_.value_or(closed(error)));
    else
      self->on_read(bytes);
  };
  if (tls_)
    tls_->stream.async_read_some(boost::asio::buffer(buffer_), done);
  else
    socket_.async_read_some(boost::asio::buffer(buffer_), done);
}

void FrameSocket::on_read(std::size_t bytes) {
  if (!refused_) {
    auto frames = reader_.feed(std::span(buffer_).first(bytes));
    if (!frames) return end(frames.error());
    for (Frame& frame : *frames) {
      const auto handlers = handlers_;
      if (!handlers || refused_) break;
      const auto ok = handlers->received(std::move(frame));
      if (!ok && side_ == Side::connects) return end(ok.error());
      if (!ok) refuse(ok.error());
    }
  }
  if (handlers_) read();
}

void FrameSocket::wake() {
  const auto handlers = handlers_;
  if (busy_ || !open_ || !handlers || refused_) return;
  if (auto frame = handlers->next()) write(std::move(*frame));
}

void FrameSocket::write(OutFrame frame) {
  busy_ = true;
  writing_ = std::move(frame);
  const std::size_t bytes = writing_.payload ? writing_.payload->size() : 0;
  header_ = encode_frame_header(writing_.kind, writing_.id, bytes);
  const std::array<boost::asio::const_buffer, 2> buffers = {
      boost::asio::buffer(header_),
      boost::asio::const_buffer(bytes > 0 ? writing_.payload->data() : nullptr, bytes)};
  const auto done = [self = shared_from_this()](const auto& error, std::size_t) {
    self->on_written(error);
  };
  if (tls_)
    boost::asio::async_write(tls_->stream, buffers, done);
  else
    boost::asio::async_write(socket_, buffers, done);
}

void FrameSocket::on_written(const boost::system::error_code& error) {
  busy_ = false;
  const bool was_refusal = writing_.kind == FrameKind::refusal;
  writing_ = {};
  if (error) return end(refused_.value_or(closed(error)));
  if (!refused_) return wake();
  if (!was_refusal) return refuse(*refused_);
  // Lets the peer close: closing with unread bytes would send a reset and lose the refusal.
  boost::system::error_code ignored;
  socket_.shutdown(boost::asio::ip::tcp::socket::shutdown_send, ignored);
}

void FrameSocket::refuse(const Error& why) {
  if (!handlers_) return;
  const bool is_first = !refused_;
  refused_ = why;
  if (is_first) end_in(kRefusalPatience, why);
  if (busy_) return;  // on_written() continues
  const std::string text = why.message.substr(0, kLongestRefusal);
  const auto bytes = std::as_bytes(std::span(text));
  write({FrameKind::refusal, 0,
         std::make_shared<const std::vector<std::byte>>(bytes.begin(), bytes.end())});
  if (!open_) read();
}

void FrameSocket::end_in(std::chrono::milliseconds patience, const Error& why) {
  timer_.expires_after(patience);
  timer_.async_wait([weak = weak_from_this(), why](const auto& error) {
    if (const auto self = weak.lock(); self && !error) self->end(why);
  });
}

void FrameSocket::end(const Error& why) {
  const auto handlers = std::exchange(handlers_, nullptr);
  if (!handlers) return;
  timer_.cancel();
  boost::system::error_code ignored;
  socket_.close(ignored);
  boost::asio::post(socket_.get_executor(),
                    [self = shared_from_this(), handlers, why] { handlers->ended(why); });
}

}  // namespace mr::net
