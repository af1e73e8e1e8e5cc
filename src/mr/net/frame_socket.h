#pragma once

#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "mr/net/frames.h"
#include "mr/net/outbox.h"

namespace mr::net {

/// Low delay, a dead peer noticed within seconds, and little room for stale data in the kernel.
/// Options that the system lacks are left out.
void tune_socket(boost::asio::ip::tcp::socket& socket);

struct OutFrame {
  FrameKind kind = FrameKind::hello;
  std::uint64_t id = 0;
  Message payload;  ///< null: empty
};

/// Frames over one connected socket. Everything runs on the socket's io thread.
class FrameSocket : public std::enable_shared_from_this<FrameSocket> {
 public:
  struct Handlers {
    /// An error ends the connection.
    std::function<Status(Frame)> received;
    /// What to send next, asked when the socket is free.
    std::function<std::optional<OutFrame>()> next;
    /// The connection is over; called once, the last of all.
    std::function<void(const Error&)> ended;
  };

  FrameSocket(boost::asio::ip::tcp::socket socket, FrameLimits limits, Handlers handlers);

  void start();
  /// Something may have to be sent.
  void wake();
  void end(const Error& why);

 private:
  void read();
  void on_read(std::size_t bytes);

  boost::asio::ip::tcp::socket socket_;
  FrameReader reader_;
  std::shared_ptr<Handlers> handlers_;  ///< null once ended
  std::vector<std::byte> buffer_;
  std::array<std::byte, kFrameHeaderBytes> header_{};
  OutFrame writing_;
  bool busy_ = false;  ///< with writing_
};

}  // namespace mr::net
