#include "mr/net/web_server_impl.h"

#include "mr/net/address.h"

namespace mr::net {
namespace asio = boost::asio;
using tcp = asio::ip::tcp;

namespace {

constexpr std::chrono::milliseconds kWebAcceptAgain{100};

/// A TLS context with the certificate. Error invalid: it cannot be used.
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

bool is_loopback_name(const std::string& host) {
  boost::system::error_code error;
  const auto address = asio::ip::make_address(host, error);
  return error ? host == "localhost" : address.is_loopback();
}

bool is_loopback(const std::string& listen) {
  const auto address = parse_address(listen);
  return address && is_loopback_name(address->host);
}

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
    drops.count("web server", error.message());  // for example, out of file descriptors
    accept_timer.expires_after(kWebAcceptAgain);
    accept_timer.async_wait([this](const auto& cancelled) {
      if (!cancelled) accept();
    });
  });
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
