#include "mr/net/web_server.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <optional>
#include <utility>

#include "mr/net/address.h"
#include "mr/net/drops.h"
#include "mr/net/io_thread.h"
#include "mr/net/static_files.h"
#include "mr/net/web_socket.h"

namespace mr::net {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;

namespace {

constexpr std::uint32_t kHeaderBytes = 8u << 10;
constexpr std::chrono::seconds kResponsePatience{60};  // a large file over a slow link
constexpr std::chrono::milliseconds kWebAcceptAgain{100};
constexpr int kUnsentBytes = 128 << 10;

constexpr const char* kContentSecurity =
    "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; "
    "connect-src 'self' blob:; img-src 'self' blob: data:; media-src 'self' blob:; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'";

/// No delay, little stale data in the kernel, and the congestion control that holds up under loss,
/// where the system has them.
void tune(tcp::socket& socket) {
  const int handle = socket.native_handle();
  const int on = 1;
  static_cast<void>(::setsockopt(handle, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on));
  static_cast<void>(
      ::setsockopt(handle, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kUnsentBytes, sizeof kUnsentBytes));
  static_cast<void>(::setsockopt(handle, IPPROTO_TCP, TCP_CONGESTION, "bbr", 3));
}

/// Whether a request may open the stream: a browser tells the page it comes from.
bool same_origin(const WebSocket::Request& request) {
  const auto origin = request.find(http::field::origin);
  if (origin == request.end()) return true;
  const beast::string_view text = origin->value();
  const std::size_t scheme = text.find("://");
  return scheme != beast::string_view::npos &&
         beast::iequals(text.substr(scheme + 3), request[http::field::host]);
}

std::string entity_tag(const std::filesystem::path& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  const auto time = std::filesystem::last_write_time(path, error).time_since_epoch().count();
  return "W/\"" + std::to_string(size) + "-" + std::to_string(time) + "\"";
}

/// What takes part in one count of live connections.
std::shared_ptr<void> counted(const std::shared_ptr<int>& count) {
  ++*count;
  return {nullptr, [count](void*) { --*count; }};
}

}  // namespace

struct WebServer::Impl {
  explicit Impl(const WebConfig& c)
      : config(c), thread(nullptr), acceptor(thread.io()), accept_timer(thread.io()) {}
  ~Impl() { thread.stop(); }

  Status listen();
  void accept();
  void accepted(tcp::socket socket);
  void upgrade(beast::tcp_stream stream, std::shared_ptr<void> connection,
               const WebSocket::Request& request);
  /// Runs on the io thread when the client is still there.
  template <typename F>
  void with_client(ClientId id, F function) {
    asio::post(thread.io(), [this, id, function = std::move(function)]() mutable {
      const auto at = clients.find(id);
      if (at != clients.end()) function(*std::shared_ptr(at->second));
    });
  }

  const WebConfig config;
  WebHandlers handlers;
  Drops drops;
  IoThread thread;  // before all that lives on it
  tcp::acceptor acceptor;
  asio::steady_timer accept_timer;
  std::shared_ptr<int> connections = std::make_shared<int>(0);
  std::map<ClientId, std::shared_ptr<WebSocket>> clients;
  ClientId last_client = 0;
  int port = 0;
};

namespace {

/// One connection until it closes or becomes a WebSocket.
class HttpSession : public std::enable_shared_from_this<HttpSession> {
 public:
  using Upgrade =
      std::function<void(beast::tcp_stream, std::shared_ptr<void>, const WebSocket::Request&)>;

  HttpSession(tcp::socket socket, std::shared_ptr<void> connection, const WebConfig& config,
              Drops& drops, const std::map<ClientId, std::shared_ptr<WebSocket>>& clients,
              Upgrade upgrade)
      : stream_(std::move(socket)),
        connection_(std::move(connection)),
        config_(config),
        drops_(drops),
        clients_(clients),
        upgrade_(std::move(upgrade)) {}

  void read() {
    parser_.emplace();
    parser_->header_limit(kHeaderBytes);
    parser_->body_limit(std::uint64_t{0});
    stream_.expires_after(config_.patience);
    http::async_read(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](const auto& error, std::size_t) { self->on_read(error); });
  }

 private:
  void on_read(const boost::system::error_code& error) {
    if (error == beast::error::timeout && parser_->got_some()) drops_.count("browser", "too slow");
    if (error == http::error::header_limit || error == http::error::body_limit) {
      drops_.count("browser", "request too large");
      request_ = {};
      request_.keep_alive(false);
      return refuse(http::status::request_header_fields_too_large, "too large");
    }
    if (error) return;
    request_ = parser_->release();
    answer();
  }

  void answer() {
    const auto path = target_path({request_.target().data(), request_.target().size()});
    const bool upgrade = beast::websocket::is_upgrade(request_);
    if (upgrade || (path && *path == "/stream"))
      return answer_stream(path && *path == "/stream", upgrade);
    if (request_.method() != http::verb::get && request_.method() != http::verb::head)
      return refuse(http::status::method_not_allowed, "only GET and HEAD");
    const auto file =
        find_static_file(config_.root, {request_.target().data(), request_.target().size()});
    if (file) return send_file(*file);
    if (file.error().cause == Error::Cause::invalid)
      return refuse(http::status::bad_request, file.error().message);
    refuse(http::status::not_found, file.error().message);
  }

  void answer_stream(bool right_path, bool upgrade) {
    if (!right_path) return refuse(http::status::not_found, "WebSockets are at /stream");
    if (!upgrade) return refuse(http::status::upgrade_required, "this is a WebSocket");
    if (!same_origin(request_)) {
      drops_.count("browser", "page of another site");
      return refuse(http::status::forbidden, "only pages of this server may watch");
    }
    if (clients_.size() >= static_cast<std::size_t>(config_.clients)) {
      drops_.count("browser", "too many clients");
      return refuse(http::status::service_unavailable, "too many viewers, try again later");
    }
    upgrade_(std::move(stream_), std::move(connection_), request_);
  }

  void send_file(const StaticFile& file) {
    const std::string tag = entity_tag(file.path);
    if (request_[http::field::if_none_match] == tag)
      return send(head<http::empty_body>(http::status::not_modified, file, tag));
    http::file_body::value_type body;
    boost::system::error_code error;
    body.open(file.path.c_str(), beast::file_mode::scan, error);
    if (error) return refuse(http::status::not_found, "no such file");
    const std::uint64_t size = body.size();
    if (request_.method() == http::verb::head) {
      auto response = head<http::empty_body>(http::status::ok, file, tag);
      response.content_length(size);
      return send(std::move(response));
    }
    auto response = head<http::file_body>(http::status::ok, file, tag);
    response.body() = std::move(body);
    response.content_length(size);
    send(std::move(response));
  }

  template <typename Body>
  http::response<Body> head(http::status status, const StaticFile& file, const std::string& tag) {
    auto response = bare<Body>(status);
    response.set(http::field::content_type, file.mime);
    response.set(http::field::etag, tag);
    response.set(http::field::cache_control,
                 file.immutable ? "public, max-age=31536000, immutable" : "no-cache");
    return response;
  }

  template <typename Body>
  http::response<Body> bare(http::status status) {
    http::response<Body> response(status, 11);
    response.keep_alive(request_.keep_alive());
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Content-Security-Policy", kContentSecurity);
    response.set("Referrer-Policy", "no-referrer");
    return response;
  }

  void refuse(http::status status, const std::string& why) {
    auto response = bare<http::string_body>(status);
    response.set(http::field::content_type, "text/plain; charset=utf-8");
    response.set(http::field::cache_control, "no-store");
    if (status == http::status::method_not_allowed) response.set(http::field::allow, "GET, HEAD");
    if (status == http::status::upgrade_required) response.set(http::field::upgrade, "websocket");
    response.body() = why + "\n";
    response.prepare_payload();
    if (request_.method() == http::verb::head) response.body().clear();
    send(std::move(response));
  }

  template <typename Body>
  void send(http::response<Body> response) {
    auto message = std::make_shared<http::response<Body>>(std::move(response));
    stream_.expires_after(kResponsePatience);
    http::async_write(stream_, *message,
                      [self = shared_from_this(), message](const auto& error, std::size_t) {
                        if (!error && message->keep_alive()) return self->read();
                        boost::system::error_code ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                      });
  }

  beast::tcp_stream stream_;
  std::shared_ptr<void> connection_;
  const WebConfig& config_;
  Drops& drops_;
  const std::map<ClientId, std::shared_ptr<WebSocket>>& clients_;
  Upgrade upgrade_;
  beast::flat_buffer buffer_{kHeaderBytes + 1024};
  std::optional<http::request_parser<http::empty_body>> parser_;
  WebSocket::Request request_;
};

}  // namespace

Status WebServer::Impl::listen() {
  const auto address = parse_address(config.listen);
  if (!address) return address.error();
  boost::system::error_code error;
  tcp::resolver resolver(thread.io());
  const auto endpoints =
      resolver.resolve(address->host, address->port, tcp::resolver::passive, error);
  for (const auto& entry : endpoints) {
    acceptor.close(error);
    acceptor.open(entry.endpoint().protocol(), error);
    if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
    if (!error) acceptor.bind(entry.endpoint(), error);
    if (!error) acceptor.listen(tcp::acceptor::max_listen_connections, error);
    if (!error) break;
  }
  if (error)
    return Error{Error::Cause::io, "cannot listen on " + to_string(*address) + ": " +
                                       error.message() +
                                       "; stop what uses it, or choose another address"};
  port = acceptor.local_endpoint().port();
  accept();
  return {};
}

void WebServer::Impl::accept() {
  acceptor.async_accept([this](const auto& error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error) {
      accepted(std::move(socket));
      return accept();
    }
    drops.count("web server", error.message());  // out of file descriptors, say
    accept_timer.expires_after(kWebAcceptAgain);
    accept_timer.async_wait([this](const auto& cancelled) {
      if (!cancelled) accept();
    });
  });
}

void WebServer::Impl::accepted(tcp::socket socket) {
  if (*connections >= config.connections) return drops.count("browser", "too many connections");
  tune(socket);
  std::make_shared<HttpSession>(std::move(socket), counted(connections), config, drops, clients,
                                [this](beast::tcp_stream stream, std::shared_ptr<void> connection,
                                       const WebSocket::Request& request) {
                                  upgrade(std::move(stream), std::move(connection), request);
                                })
      ->read();
}

void WebServer::Impl::upgrade(beast::tcp_stream stream, std::shared_ptr<void> connection,
                              const WebSocket::Request& request) {
  const ClientId id = ++last_client;
  auto client = std::make_shared<WebSocket>(std::move(stream), std::move(connection), id, config,
                                            handlers, drops);
  clients[id] = client;
  client->accept(request);
}

WebServer::WebServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WebServer::~WebServer() = default;

Result<std::unique_ptr<WebServer>> WebServer::start(const WebConfig& config, WebHandlers handlers) {
  try {
    auto impl = std::make_unique<Impl>(config);
    if (auto ok = impl->listen(); !ok) return ok.error();
    impl->handlers = std::move(handlers);
    impl->handlers.closed = [i = impl.get(), tell = std::move(impl->handlers.closed)](ClientId id) {
      const bool opened = i->clients.at(id)->opened();
      i->clients.erase(id);
      if (opened && tell) tell(id);
    };
    impl->thread.start();
    return std::unique_ptr<WebServer>(new WebServer(std::move(impl)));
  } catch (const std::exception& e) {
    return Error{Error::Cause::io, "web server on " + config.listen + ": " + e.what()};
  }
}

int WebServer::port() const { return impl_->port; }

void WebServer::send(ClientId client, Message message) {
  impl_->with_client(client, [message = std::move(message)](WebSocket& socket) mutable {
    socket.send(std::move(message), false);
  });
}

void WebServer::send_text(ClientId client, const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  auto message = std::make_shared<const std::vector<std::byte>>(bytes.begin(), bytes.end());
  impl_->with_client(client, [message = std::move(message)](WebSocket& socket) mutable {
    socket.send(std::move(message), true);
  });
}

void WebServer::close(ClientId client, const std::string& reason) {
  impl_->with_client(client, [reason](WebSocket& socket) { socket.close(reason); });
}

std::map<std::string, std::uint64_t> WebServer::drops() const { return impl_->drops.all(); }

}  // namespace mr::net
