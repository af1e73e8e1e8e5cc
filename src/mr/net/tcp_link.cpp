#include "mr/net/tcp_link.h"

#include <algorithm>
#include <boost/asio/connect.hpp>
#include <utility>

namespace mr::net {
namespace asio = boost::asio;
using tcp = asio::ip::tcp;

namespace {

constexpr std::chrono::milliseconds kFirstBackoff{50};
constexpr std::chrono::milliseconds kLongestBackoff{1000};
constexpr std::chrono::seconds kConnectPatience{5};
constexpr std::chrono::seconds kSettled{1};  // after this time the peer has not refused us
constexpr std::size_t kTroubles = 8;

Message greeting(const std::string& node) {
  const std::string text = std::string(kHello) + node;
  const auto bytes = std::as_bytes(std::span(text));
  return as_message({bytes.begin(), bytes.end()});
}

/// TCP self-connection: the system may choose as our local port the very port that we connect to.
/// Such a connection would keep the node from listening there.
bool is_its_own_peer(const tcp::socket& socket) {
  boost::system::error_code error;
  const auto here = socket.local_endpoint(error);
  return !error && here == socket.remote_endpoint(error);
}

}  // namespace

TcpLink::TcpLink(asio::io_context& io, std::string node, Address address,
                 const PacketRegistry& packets, const TransportLimits& limits, Drops& drops,
                 std::shared_ptr<TcpSecret> secret)
    : io_(io),
      node_(std::move(node)),
      address_(std::move(address)),
      packets_(packets),
      limits_(limits),
      drops_(drops),
      secret_(std::move(secret)),
      resolver_(io),
      connecting_(io),
      timer_(io),
      backoff_(kFirstBackoff) {}

void TcpLink::request(Message message, std::function<void(Message)> on_answer) {
  const auto now = std::chrono::steady_clock::now();
  if (message->size() > kMaxRequestBytes)
    drops_.count("node " + node_, "request too large");
  else if (requests_.add(now, std::move(message), std::move(on_answer)) == 0)
    drops_.count("node " + node_, "too many requests at once");
}

bool TcpLink::wanted() const { return packets_.has(node_) || !requests_.empty(); }

void TcpLink::wake() {
  if (state_ == State::up)
    socket_->wake();
  else if (state_ == State::idle && wanted())
    connect();
}

void TcpLink::tick() {
  drops_.count("node " + node_, "requests without an answer",
               requests_.expire(std::chrono::steady_clock::now()));
  if (state_ != State::up) return;
  if (open_since_ && std::chrono::steady_clock::now() - *open_since_ > kSettled) settled();
  if (wanted())
    socket_->wake();
  else
    socket_->end({Error::Cause::empty, "no longer needed"});
}

/// The connection has lasted: resets backoff and logged errors.
void TcpLink::settled() {
  backoff_ = kFirstBackoff;
  if (!std::exchange(logged_, {}).empty()) log("is back");
}

void TcpLink::connect() {
  state_ = State::connecting;
  timer_.expires_after(kConnectPatience);
  timer_.async_wait([this](const auto& error) {
    if (error || state_ != State::connecting) return;
    resolver_.cancel();
    boost::system::error_code ignored;
    connecting_.close(ignored);
  });
  resolver_.async_resolve(
      address_.host, address_.port, [this](const auto& error, const auto& endpoints) {
        if (error) return failed({Error::Cause::io, error.message()});
        asio::async_connect(connecting_, endpoints, [this](const auto& refused, const auto&) {
          if (refused) return failed({Error::Cause::io, refused.message()});
          connected(std::exchange(connecting_, tcp::socket(io_)));
        });
      });
}

void TcpLink::connected(tcp::socket socket) {
  timer_.cancel();
  if (is_its_own_peer(socket)) return failed({Error::Cause::io, "Connection refused"});
  state_ = State::up;
  greeted_ = subscribed_ = false;
  asked_ = 0;
  open_since_.reset();
  const FrameLimits limits = {{FrameKind::packet, limits_.message_bytes},
                              {FrameKind::answer, limits_.message_bytes},
                              {FrameKind::refusal, kLongestRefusal}};
  socket_ = std::make_shared<FrameSocket>(
      std::move(socket), FrameSocket::Side::connects, secret_, limits,
      FrameSocket::Handlers{[this](Frame frame) { return received(std::move(frame)); },
                            [this] { return next(); }, [this](const Error& why) { failed(why); },
                            [this] { open_since_ = std::chrono::steady_clock::now(); }});
  socket_->start();
}

Status TcpLink::received(Frame frame) {
  if (frame.kind == FrameKind::refusal)
    return Error{Error::Cause::invalid,
                 "refused: " + printable({reinterpret_cast<const char*>(frame.payload.data()),
                                          frame.payload.size()})};
  settled();
  const Message message = as_message(std::move(frame.payload));
  if (frame.kind == FrameKind::packet) {
    for (const auto& callback : packets_.of(node_)) (*callback)(message);
  } else if (const auto on_answer = requests_.take(frame.id)) {
    on_answer(message);
  }
  return {};
}

std::optional<OutFrame> TcpLink::next() {
  if (!std::exchange(greeted_, true)) return OutFrame{FrameKind::hello, 0, greeting(node_)};
  const bool subscribe = packets_.has(node_);
  if (std::exchange(subscribed_, subscribe) != subscribe)
    return OutFrame{subscribe ? FrameKind::subscribe : FrameKind::unsubscribe, 0, nullptr};
  auto request = requests_.next_after(asked_);
  if (!request) return std::nullopt;
  asked_ = request->id;
  return OutFrame{FrameKind::request, request->wants_answer ? request->id : 0,
                  std::move(request->message)};
}

void TcpLink::failed(const Error& why) {
  socket_.reset();
  if (why.cause != Error::Cause::io && why.cause != Error::Cause::empty)
    drops_.count("node " + node_, why.message);
  if (!wanted()) {
    state_ = State::idle;
    return;
  }
  // Broken connections are logged once, whatever the cause; refusals once per reason.
  const bool broke = why.cause == Error::Cause::io || why.cause == Error::Cause::empty;
  if (logged_.size() < kTroubles && logged_.insert(broke ? "" : why.message).second)
    log(why.message + "; trying on");
  state_ = State::waiting;
  timer_.expires_after(backoff_);
  backoff_ = std::min(2 * backoff_, kLongestBackoff);
  timer_.async_wait([this](const auto& error) {
    if (error) return;
    state_ = State::idle;
    wake();
  });
}

void TcpLink::log(const std::string& line) const {
  if (limits_.log) limits_.log("node " + node_ + " at " + to_string(address_) + ": " + line);
}

}  // namespace mr::net
