#include "mr/net/frame_socket.h"

#include <netinet/tcp.h>
#include <sys/socket.h>

#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/write.hpp>
#include <utility>

namespace mr::net {
namespace {

constexpr std::size_t kReadBytes = 256u << 10;
constexpr int kSendBufferBytes = 1 << 20;
constexpr int kPatienceMs = 6000;  // with a peer that takes nothing

Error closed(const boost::system::error_code& error) {
  return {Error::Cause::io, error == boost::asio::error::eof ? "closed" : error.message()};
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

FrameSocket::FrameSocket(boost::asio::ip::tcp::socket socket, FrameLimits limits, Handlers handlers)
    : socket_(std::move(socket)),
      reader_(std::move(limits)),
      handlers_(std::make_shared<Handlers>(std::move(handlers))),
      buffer_(kReadBytes) {}

void FrameSocket::start() {
  tune_socket(socket_);
  read();
  wake();
}

void FrameSocket::read() {
  socket_.async_read_some(boost::asio::buffer(buffer_),
                          [self = shared_from_this()](const auto& error, std::size_t bytes) {
                            if (error)
                              self->end(closed(error));
                            else
                              self->on_read(bytes);
                          });
}

void FrameSocket::on_read(std::size_t bytes) {
  auto frames = reader_.feed(std::span(buffer_).first(bytes));
  if (!frames) return end(frames.error());
  for (Frame& frame : *frames) {
    const auto handlers = handlers_;
    if (!handlers) return;
    if (auto ok = handlers->received(std::move(frame)); !ok) return end(ok.error());
  }
  if (handlers_) read();
}

void FrameSocket::wake() {
  const auto handlers = handlers_;
  if (busy_ || !handlers) return;
  auto frame = handlers->next();
  if (!frame) return;
  busy_ = true;
  writing_ = std::move(*frame);
  const std::size_t bytes = writing_.payload ? writing_.payload->size() : 0;
  header_ = encode_frame_header(writing_.kind, writing_.id, bytes);
  const std::array<boost::asio::const_buffer, 2> buffers = {
      boost::asio::buffer(header_),
      boost::asio::const_buffer(bytes > 0 ? writing_.payload->data() : nullptr, bytes)};
  boost::asio::async_write(socket_, buffers,
                           [self = shared_from_this()](const auto& error, std::size_t) {
                             self->busy_ = false;
                             self->writing_ = {};
                             if (error) return self->end(closed(error));
                             self->wake();
                           });
}

void FrameSocket::end(const Error& why) {
  const auto handlers = std::exchange(handlers_, nullptr);
  if (!handlers) return;
  boost::system::error_code ignored;
  socket_.close(ignored);
  boost::asio::post(socket_.get_executor(),
                    [self = shared_from_this(), handlers, why] { handlers->ended(why); });
}

}  // namespace mr::net
