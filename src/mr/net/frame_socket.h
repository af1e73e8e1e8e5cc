#pragma once

#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mr/net/frames.h"
#include "mr/net/outbox.h"

namespace mr::net {

class TcpSecret;

/// Sets TCP_NODELAY, keep-alive and TCP_USER_TIMEOUT (a dead peer is noticed within seconds), and a
/// bounded kernel send buffer, in which data would become stale. Options that the system lacks are
/// left out.
void tune_socket(boost::asio::ip::tcp::socket& socket);

struct OutFrame {
  FrameKind kind = FrameKind::hello;
  std::uint64_t id = 0;
  Message payload;  ///< null: empty
};

/// Sends and receives frames over one connected TCP socket, within TLS when there is a shared
/// secret. Everything runs on the socket's io thread.
class FrameSocket : public std::enable_shared_from_this<FrameSocket> {
 public:
  enum class Side { connects, listens };
  struct Handlers {
    /// Handles a frame. An Error ends the connection; the listening side sends the reason.
    std::function<Status(Frame)> received;
    /// Called when the socket can send: returns the next frame, if there is one.
    std::function<std::optional<OutFrame>()> next;
    /// The connection has ended. Called once, as the last handler.
    std::function<void(const Error&)> ended;
    /// The TLS handshake is over and frames can be sent. On the listening side: once the first
    /// bytes have come.
    std::function<void()> opened = nullptr;
  };

  /// `secret`: null for a plain connection. A peer of the other kind is refused.
  FrameSocket(boost::asio::ip::tcp::socket socket, Side side, std::shared_ptr<TcpSecret> secret,
              FrameLimits limits, Handlers handlers);
  ~FrameSocket();

  void start();
  /// Makes the socket call `next` again, as there may be a frame to send.
  void wake();
  void end(const Error& why);
  /// Sends the peer a refusal with the reason, then ends the connection. Received data is discarded
  /// meanwhile.
  void refuse(const Error& why);

 private:
  struct Tls;
  void read_first();
  void on_first(std::size_t bytes);
  void on_handshake(const boost::system::error_code& error);
  void open();
  void read();
  void on_read(std::size_t bytes);
  void write(OutFrame frame);
  void on_written(const boost::system::error_code& error);
  void end_in(std::chrono::milliseconds patience, const Error& why);

  boost::asio::ip::tcp::socket socket_;
  const Side side_;
  const std::shared_ptr<TcpSecret> secret_;
  std::unique_ptr<Tls> tls_;  ///< null: the connection is plain, so far or for good
  FrameReader reader_;
  std::shared_ptr<Handlers> handlers_;  ///< null once ended
  boost::asio::steady_timer timer_;     ///< deadline of the handshake or of a refusal
  std::vector<std::byte> buffer_;
  std::array<std::byte, kFrameHeaderBytes> header_{};
  OutFrame writing_;
  std::optional<Error> refused_;
  bool open_ = false;
  bool busy_ = false;  ///< sending writing_
};

}  // namespace mr::net
