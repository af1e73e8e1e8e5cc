#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <boost/beast/core/detect_ssl.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <optional>
#include <utility>

#include "mr/net/static_files.h"
#include "mr/net/web_server_impl.h"

/// HTTP/1.1 on one connection of the web server: files, generated pages, and the upgrade to
/// WebSocket.
namespace mr::net {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;

namespace {

constexpr std::uint32_t kHeaderBytes = 8u << 10;
constexpr std::chrono::seconds kResponsePatience{60};  // a large file over a slow link
constexpr int kUnsentBytes = 128 << 10;

constexpr const char* kContentSecurity =
    "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; "
    "connect-src 'self' blob:; img-src 'self' blob: data:; media-src 'self' blob:; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'";

/// Disables Nagle's algorithm, limits unsent data in the kernel, and selects a congestion control
/// that tolerates loss, as far as the system supports it.
void tune(tcp::socket& socket) {
  const int handle = socket.native_handle();
  const int on = 1;
  static_cast<void>(::setsockopt(handle, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on));
  static_cast<void>(
      ::setsockopt(handle, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kUnsentBytes, sizeof kUnsentBytes));
  static_cast<void>(::setsockopt(handle, IPPROTO_TCP, TCP_CONGESTION, "bbr", 3));
}

/// Whether the Origin header matches Host: pages of other sites may not open the stream.
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

/// The value of one cookie; empty: it is missing.
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

}  // namespace

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

  /// Starts a session if the quota has a slot.
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
  /// Detects TLS. Plain HTTP on a TLS port is redirected to https.
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
    // One deadline for the whole request, against slow senders (slowloris).
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

  /// Compares the Host header by name, against DNS rebinding.
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

void WebServer::Impl::accepted(tcp::socket socket) {
  tune(socket);
  HttpSession::start(std::move(socket), *this);
}

}  // namespace mr::net
