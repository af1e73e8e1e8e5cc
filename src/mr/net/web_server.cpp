#include "mr/net/web_server.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/detect_ssl.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <optional>
#include <utility>

#include "mr/net/address.h"
#include "mr/net/connection_quota.h"
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

std::string_view view_of(beast::string_view text) { return {text.data(), text.size()}; }

/// "host", "host:port", "[v6]:port" without the port and brackets, in lower case.
std::string host_name(beast::string_view host) {
  std::string name(host);
  const std::size_t end = name.starts_with('[') ? name.find(']') : name.rfind(':');
  if (end != std::string::npos) name.resize(end);
  if (name.starts_with('[')) name.erase(0, 1);
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

bool is_loopback_name(const std::string& host) {
  boost::system::error_code error;
  const auto address = asio::ip::make_address(host, error);
  return error ? host == "localhost" : address.is_loopback();
}

/// The value of one cookie; empty where it is not there.
std::string cookie(beast::string_view all, std::string_view name) {
  std::string_view rest = view_of(all);
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(';'), rest.size());
    std::string_view one = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    one.remove_prefix(std::min(one.find_first_not_of(' '), one.size()));
    if (one.starts_with(name) && one.size() > name.size() && one[name.size()] == '=')
      return std::string(one.substr(name.size() + 1));
  }
  return {};
}

std::string token_of(const WebSocket::Request& request) {
  constexpr std::string_view kBearer = "Bearer ";
  const std::string_view authorization = view_of(request[http::field::authorization]);
  if (authorization.starts_with(kBearer)) return std::string(authorization.substr(kBearer.size()));
  return cookie(request[http::field::cookie], kTokenCookie);
}

/// A context that shows the certificate; invalid: it cannot be used.
Result<std::unique_ptr<asio::ssl::context>> tls_context(const Certificate& certificate) {
  try {
    auto context = std::make_unique<asio::ssl::context>(asio::ssl::context::tls_server);
    context->set_options(asio::ssl::context::default_workarounds | asio::ssl::context::no_tlsv1 |
                         asio::ssl::context::no_tlsv1_1);
    context->use_certificate_chain(asio::buffer(certificate.chain_pem));
    context->use_private_key(asio::buffer(certificate.key_pem), asio::ssl::context::pem);
    return context;
  } catch (const std::exception& e) {
    return Error{Error::Cause::invalid,
                 std::string("the TLS certificate cannot be used: ") + e.what()};
  }
}

}  // namespace

bool is_loopback(const std::string& listen) {
  const auto address = parse_address(listen);
  return address && is_loopback_name(address->host);
}

struct WebServer::Impl {
  explicit Impl(const WebConfig& c)
      : config(c),
        beyond_loopback(!is_loopback(c.listen)),
        thread(nullptr),
        acceptor(thread.io()),
        accept_timer(thread.io()),
        connections({c.connections, c.connections_per_address}),
        client_slots({c.clients, c.clients_per_address}) {}
  ~Impl() { thread.stop(); }

  Status listen();
  void accept();
  void accepted(tcp::socket socket);
  /// False: there is no slot for the client.
  bool upgrade(WebStream& stream, std::shared_ptr<ConnectionQuota::Slot> connection,
               const WebSocket::Request& request, const Visitor& visitor);
  /// Runs on the io thread when the client is still there.
  template <typename F>
  void with_client(ViewerId id, F function) {
    asio::post(thread.io(), [this, id, function = std::move(function)]() mutable {
      const auto at = clients.find(id);
      if (at != clients.end()) function(*std::shared_ptr(at->second));
    });
  }

  const WebConfig config;
  const bool beyond_loopback;
  WebPages pages;
  ViewerEvents events;
  Drops drops;
  std::atomic<std::uint64_t> sent_bytes = 0;
  std::unique_ptr<asio::ssl::context> tls;  // null: plain
  IoThread thread;                          // before all that lives on it
  tcp::acceptor acceptor;
  asio::steady_timer accept_timer;
  ConnectionQuota connections, client_slots;
  std::map<ViewerId, std::shared_ptr<WebSocket>> clients;
  int port = 0;
};

/// One connection until it closes or becomes a WebSocket.
class HttpSession : public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(tcp::socket socket, WebServer::Impl& server)
      : stream_(std::move(socket)), server_(server) {
    boost::system::error_code error;
    const auto& connected = stream_.tcp().socket();
    peer_ = peer_of(connected.remote_endpoint(error).address());
    local_address_ = unmapped(connected.local_endpoint(error).address()).to_string();
  }

  /// Null: there is no slot for it.
  static void start(tcp::socket socket, WebServer::Impl& server) {
    const auto session = std::make_shared<HttpSession>(std::move(socket), server);
    session->connection_ =
        server.connections.acquire(session->peer_, [weak = std::weak_ptr(session)] {
          if (const auto self = weak.lock()) self->evict();
        });
    if (!session->connection_) return server.drops.count("browser", "too many connections");
    session->begin();
  }

 private:
  /// Whoever speaks plain HTTP to a port of TLS is sent to the right scheme.
  void begin() {
    stream_.tcp().expires_after(server_.config.patience);
    if (!server_.tls) return read();
    beast::async_detect_ssl(
        stream_.tcp(), buffer_, [self = shared_from_this()](const auto& error, bool is_tls) {
          if (error) return;
          if (!is_tls) return self->read();
          self->stream_.async_start_tls(*self->server_.tls, self->buffer_.data(),
                                        [self](const auto& failed, std::size_t used) {
                                          self->buffer_.consume(used);
                                          self->shook_hands(failed);
                                        });
        });
  }

  void shook_hands(const boost::system::error_code& error) {
    if (!error) return read();
    if (error != asio::error::eof && error != asio::error::operation_aborted)
      server_.drops.count("browser", "TLS: " + error.message());
  }

  void evict() {
    server_.drops.count("browser", "idle, its place was needed");
    stream_.tcp().close();
  }

  void read() {
    parser_.emplace();
    parser_->header_limit(kHeaderBytes);
    parser_->body_limit(std::uint64_t{0});
    // For all of it: whoever sends a byte now and then gets no more.
    stream_.tcp().expires_after(is_first_ ? server_.config.patience : server_.config.idle);
    is_first_ = false;
    http::async_read(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](const auto& error, std::size_t) { self->on_read(error); });
  }

  void on_read(const boost::system::error_code& error) {
    if (error == beast::error::timeout && parser_->got_some())
      server_.drops.count("browser", "too slow");
    if (error == http::error::header_limit || error == http::error::body_limit) {
      server_.drops.count("browser", "request too large");
      request_ = {};
      request_.keep_alive(false);
      return refuse(http::status::request_header_fields_too_large, "too large");
    }
    if (error) return;
    request_ = parser_->release();
    answer();
  }

  /// By its name alone: whose name resolves to us may be anybody's.
  bool is_our_host() const {
    const std::string name = host_name(request_[http::field::host]);
    const auto& hosts = server_.config.hosts;
    if (!hosts.empty()) return std::find(hosts.begin(), hosts.end(), name) != hosts.end();
    return is_loopback_name(name) || (server_.beyond_loopback && name == local_address_);
  }

  void answer() {
    if (!is_our_host()) {
      server_.drops.count("browser", "another host's name");
      request_.keep_alive(false);
      return refuse(http::status::misdirected_request,
                    "this server does not answer for that name; see gateway.hosts");
    }
    if (server_.tls && !stream_.is_encrypted()) return send_to_https();
    const auto path = target_path({request_.target().data(), request_.target().size()});
    const bool upgrade = beast::websocket::is_upgrade(request_);
    if (upgrade || (path && *path == "/stream"))
      return answer_stream(path && *path == "/stream", upgrade);
    if (request_.method() != http::verb::get && request_.method() != http::verb::head)
      return refuse(http::status::method_not_allowed, "only GET and HEAD");
    if (path && server_.pages)
      if (auto page = server_.pages(*path, visitor())) return send_page(*std::move(page));
    const auto file =
        find_static_file(server_.config.root, {request_.target().data(), request_.target().size()});
    if (file) return send_file(*file);
    if (file.error().cause == Error::Cause::invalid)
      return refuse(http::status::bad_request, file.error().message);
    refuse(http::status::not_found, file.error().message);
  }

  Visitor visitor() const { return {peer_, token_of(request_)}; }

  void answer_stream(bool right_path, bool upgrade) {
    if (!right_path) return refuse(http::status::not_found, "WebSockets are at /stream");
    if (!upgrade) return refuse(http::status::upgrade_required, "this is a WebSocket");
    if (!same_origin(request_)) {
      server_.drops.count("browser", "page of another site");
      return refuse(http::status::forbidden, "only pages of this server may watch");
    }
    if (!server_.upgrade(stream_, connection_, request_, visitor())) {
      server_.drops.count("browser", "too many clients");
      return refuse(http::status::service_unavailable, "too many viewers, try again later");
    }
  }

  void send_to_https() {
    auto response = bare<http::string_body>(http::status::permanent_redirect);
    response.keep_alive(false);
    response.set(http::field::location, "https://" + std::string(request_[http::field::host]) +
                                            std::string(request_.target()));
    response.body() = "this server speaks TLS: use https\n";
    response.prepare_payload();
    send(std::move(response));
  }

  void send_page(WebPage page) {
    auto response = bare<http::string_body>(static_cast<http::status>(page.status));
    response.set(http::field::content_type, page.mime);
    response.set(http::field::cache_control, "no-store");
    if (page.status == 401) response.set(http::field::www_authenticate, "Bearer");
    response.body() = std::move(page.text);
    response.prepare_payload();
    if (request_.method() == http::verb::head) response.body().clear();
    send(std::move(response));
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
    stream_.tcp().expires_after(kResponsePatience);
    http::async_write(stream_, *message,
                      [self = shared_from_this(), message](const auto& error, std::size_t) {
                        if (!error && message->keep_alive()) return self->read();
                        boost::system::error_code ignored;
                        self->stream_.tcp().socket().shutdown(tcp::socket::shutdown_send, ignored);
                      });
  }

  WebStream stream_;
  WebServer::Impl& server_;
  std::string peer_, local_address_;
  std::shared_ptr<ConnectionQuota::Slot> connection_;
  bool is_first_ = true;
  beast::flat_buffer buffer_{kHeaderBytes + 1024};
  std::optional<http::request_parser<http::empty_body>> parser_;
  WebSocket::Request request_;
};

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
  tune(socket);
  HttpSession::start(std::move(socket), *this);
}

bool WebServer::Impl::upgrade(WebStream& stream, std::shared_ptr<ConnectionQuota::Slot> connection,
                              const WebSocket::Request& request, const Visitor& visitor) {
  const ViewerId id = next_viewer_id();
  auto slot = client_slots.acquire(visitor.address, [this, id] {
    with_client(id, [](WebSocket& socket) { socket.cut("shows nothing, its place was needed"); });
  });
  if (!slot) return false;
  connection->pin();
  auto client = std::make_shared<WebSocket>(std::move(stream), std::move(connection), id,
                                            WebSocket::Shared{config, events, drops, sent_bytes});
  client->set_slot(std::move(slot));
  clients[id] = client;
  client->accept(request, visitor);
  return true;
}

WebServer::WebServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WebServer::~WebServer() = default;

Result<std::unique_ptr<WebServer>> WebServer::listen(const WebConfig& config, WebPages pages) {
  try {
    auto impl = std::make_unique<Impl>(config);
    if (config.certificate) {
      auto tls = tls_context(*config.certificate);
      if (!tls) return tls.error();
      impl->tls = *std::move(tls);
    }
    if (auto ok = impl->listen(); !ok) return ok.error();
    impl->pages = std::move(pages);
    return std::unique_ptr<WebServer>(new WebServer(std::move(impl)));
  } catch (const std::exception& e) {
    return Error{Error::Cause::io, "web server on " + config.listen + ": " + e.what()};
  }
}

void WebServer::run(ViewerEvents events) {
  impl_->events = std::move(events);
  impl_->events.closed = [i = impl_.get(), tell = std::move(impl_->events.closed)](ViewerId id) {
    const bool opened = i->clients.at(id)->opened();
    i->clients.erase(id);
    if (opened && tell) tell(id);
  };
  impl_->thread.start();
}

int WebServer::port() const { return impl_->port; }

void WebServer::send(ViewerId viewer, Message message) {
  impl_->with_client(viewer, [message = std::move(message)](WebSocket& socket) mutable {
    socket.send(std::move(message), false);
  });
}

void WebServer::send_text(ViewerId viewer, const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  auto message = std::make_shared<const std::vector<std::byte>>(bytes.begin(), bytes.end());
  impl_->with_client(viewer, [message = std::move(message)](WebSocket& socket) mutable {
    socket.send(std::move(message), true);
  });
}

void WebServer::close(ViewerId viewer, const std::string& reason) {
  impl_->with_client(viewer, [reason](WebSocket& socket) { socket.close(reason); });
}

void WebServer::cut(ViewerId viewer) {
  impl_->with_client(viewer, [](WebSocket& socket) { socket.ended(); });
}

void WebServer::pin(ViewerId viewer) {
  impl_->with_client(viewer, [](WebSocket& socket) { socket.pin(); });
}

std::map<std::string, std::uint64_t> WebServer::drops() const { return impl_->drops.all(); }
std::uint64_t WebServer::sent_bytes() const { return impl_->sent_bytes; }

}  // namespace mr::net
