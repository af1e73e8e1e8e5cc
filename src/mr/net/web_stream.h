#pragma once

#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/core/bind_handler.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/websocket/teardown.hpp>
#include <memory>
#include <optional>
#include <utility>

namespace mr::net {

/// A connection of the web server, over TLS or plain TCP, which is decided at its beginning. Models
/// Boost.Beast's AsyncReadStream and AsyncWriteStream.
class WebStream {
 public:
  using executor_type = boost::beast::tcp_stream::executor_type;

  explicit WebStream(boost::asio::ip::tcp::socket socket)
      : state_(std::make_unique<State>(std::move(socket))) {}

  executor_type get_executor() { return state_->tcp.get_executor(); }
  boost::beast::tcp_stream& tcp() { return state_->tcp; }
  bool is_encrypted() const { return state_->tls != nullptr; }

  /// Performs the TLS handshake; all later data is encrypted. `received`: bytes that were read
  /// already; the handler gets the number used. The context must outlive the stream.
  template <typename Buffers, typename Handler>
  void async_start_tls(boost::asio::ssl::context& context, const Buffers& received,
                       Handler&& handler) {
    state_->tls = std::make_unique<Tls>(state_->tcp, context);
    state_->tls->async_handshake(boost::asio::ssl::stream_base::server, received,
                                 std::forward<Handler>(handler));
  }

  /// Allows so many more reads; later ones fail with connection_reset.
  void read_at_most(int times) { state_->reads_left = times; }

  template <typename Buffers, typename Handler>
  void async_read_some(const Buffers& buffers, Handler&& handler) {
    if (state_->reads_left && (*state_->reads_left)-- <= 0)
      boost::asio::post(
          get_executor(),
          boost::beast::bind_front_handler(
              std::forward<Handler>(handler),
              boost::system::error_code(boost::asio::error::connection_reset), std::size_t{0}));
    else if (state_->tls)
      state_->tls->async_read_some(buffers, std::forward<Handler>(handler));
    else
      state_->tcp.async_read_some(buffers, std::forward<Handler>(handler));
  }
  template <typename Buffers, typename Handler>
  void async_write_some(const Buffers& buffers, Handler&& handler) {
    if (state_->tls)
      state_->tls->async_write_some(buffers, std::forward<Handler>(handler));
    else
      state_->tcp.async_write_some(buffers, std::forward<Handler>(handler));
  }

 private:
  using Tls = boost::asio::ssl::stream<boost::beast::tcp_stream&>;
  struct State {
    explicit State(boost::asio::ip::tcp::socket socket) : tcp(std::move(socket)) {}
    boost::beast::tcp_stream tcp;
    std::unique_ptr<Tls> tls;
    std::optional<int> reads_left;
  };
  std::unique_ptr<State> state_;
};

// Customization points of Boost.Beast's WebSocket, found by argument-dependent lookup.
inline void beast_close_socket(WebStream& stream) { stream.tcp().close(); }

inline void teardown(boost::beast::role_type, WebStream& stream, boost::system::error_code& error) {
  stream.tcp().socket().shutdown(boost::asio::ip::tcp::socket::shutdown_both, error);
}

/// WebSocket's close frames were exchanged already, so TLS needs no close_notify.
template <typename Handler>
void async_teardown(boost::beast::role_type role, WebStream& stream, Handler&& handler) {
  boost::beast::websocket::async_teardown(role, stream.tcp().socket(),
                                          std::forward<Handler>(handler));
}

}  // namespace mr::net
