#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "mr/net/address.h"
#include "mr/net/drops.h"
#include "mr/net/frame_socket.h"
#include "mr/net/pending_requests.h"
#include "mr/net/registry.h"

namespace mr::net {

class TcpSecret;

/// The client's connection to one remote node. It is established, and restored with exponential
/// backoff, while there are subscribers to the node's packets or unanswered requests. All but
/// request() runs on the io thread, which must have ended before this is destroyed.
class TcpLink {
 public:
  TcpLink(boost::asio::io_context& io, std::string node, Address address,
          const PacketRegistry& packets, const TransportLimits& limits, Drops& drops,
          std::shared_ptr<TcpSecret> secret);

  /// Queues a request. Any thread; must be followed by wake().
  void request(Message message, std::function<void(Message)> on_answer);
  /// Connects, subscribes or sends requests when there is something to do.
  void wake();
  /// Times out old requests; disconnects from a node that is not needed. To be called about once a
  /// second.
  void tick();

 private:
  enum class State { idle, connecting, up, waiting };

  bool wanted() const;
  void connect();
  void connected(boost::asio::ip::tcp::socket socket);
  Status received(Frame frame);
  std::optional<OutFrame> next();
  void settled();
  void failed(const Error& why);
  void log(const std::string& line) const;

  boost::asio::io_context& io_;
  const std::string node_;
  const Address address_;
  const PacketRegistry& packets_;
  const TransportLimits limits_;
  Drops& drops_;
  const std::shared_ptr<TcpSecret> secret_;
  PendingRequests requests_;

  State state_ = State::idle;
  boost::asio::ip::tcp::resolver resolver_;
  boost::asio::ip::tcp::socket connecting_;
  boost::asio::steady_timer timer_;
  std::shared_ptr<FrameSocket> socket_;  ///< while up
  bool greeted_ = false, subscribed_ = false;
  std::uint64_t asked_ = 0;  ///< last request sent on this connection
  std::chrono::milliseconds backoff_;
  std::optional<std::chrono::steady_clock::time_point> open_since_;
  std::set<std::string> logged_;  ///< errors logged since it was last connected
};

}  // namespace mr::net
