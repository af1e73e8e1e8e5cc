#include "mr/net/tcp_server.h"

#include <boost/asio/connect.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <deque>
#include <utility>

#include "mr/net/frame_socket.h"

namespace mr::net {
namespace asio = boost::asio;
using tcp = asio::ip::tcp;

namespace {

constexpr std::chrono::seconds kHelloPatience{5};
constexpr std::chrono::seconds kListenAgain{1};
constexpr std::chrono::milliseconds kTcpAcceptAgain{100};
constexpr std::size_t kRefusing = 16;  // connections above the limit that are being refused
// Limits of the answers waiting for one peer; above them its requests are ignored. A program with
// several mergers sends a node several requests at once and reads the answers.
constexpr std::size_t kAnswersWaiting = 32;
constexpr std::size_t kAnswerBytesWaiting = 8u << 20;

FrameLimits accepted_frames() {
  return {{FrameKind::hello, kHello.size() + kLongestName},
          {FrameKind::subscribe, 0},
          {FrameKind::unsubscribe, 0},
          {FrameKind::request, kMaxRequestBytes},
          {FrameKind::duplicate, kLongestName}};
}

}  // namespace

/// The connection of one peer.
class TcpSession : public std::enable_shared_from_this<TcpSession> {
 public:
  TcpSession(TcpServer& server, std::string peer)
      : server_(server),
        peer_(std::move(peer)),
        hello_timer_(server.io_),
        outbox_(server.coalesce_, {server.limits_.queue_messages, server.limits_.queue_bytes}) {}

  /// Without a slot the peer is refused.
  void start(tcp::socket socket, std::shared_ptr<ConnectionQuota::Slot> slot) {
    slot_ = std::move(slot);
    if (!slot_) refused_ = "too many connections";
    const auto weak = weak_from_this();
    socket_ = std::make_shared<FrameSocket>(
        std::move(socket), FrameSocket::Side::listens, server_.secret_, accepted_frames(),
        FrameSocket::Handlers{[this, weak](Frame frame) {
                                const auto self = weak.lock();
                                return self ? received(std::move(frame)) : Status();
                              },
                              [this, weak] {
                                const auto self = weak.lock();
                                return self ? next() : std::nullopt;
                              },
                              [this, weak](const Error& why) {
                                if (const auto self = weak.lock()) ended(why);
                              },
                              [this, weak] {
                                if (const auto self = weak.lock()) opened();
                              }});
    hello_timer_.expires_after(kHelloPatience);
    hello_timer_.async_wait([this, weak](const auto& error) {
      const auto self = weak.lock();
      if (self && !error) socket_->end({Error::Cause::invalid, "no greeting in time"});
    });
    socket_->start();
  }

  /// Evicted: ends the connection in favour of a new one.
  void replace() {
    refused_ = "too many connections, and this one had not greeted";
    socket_->end({Error::Cause::invalid, refused_});
  }

  /// Any thread.
  void push(const Message& packet) {
    if (!outbox_.push(packet)) return;
    asio::post(server_.io_, [self = shared_from_this()] { self->socket_->wake(); });
  }

  /// Any thread, once subscribed.
  void report_drops() {
    const std::lock_guard lock(reported_mutex_);
    const Outbox::Counts now = outbox_.counts();
    const std::string side = "receiver " + peer_ + " of " + node_;
    server_.drops_.count(side, "packets folded", now.folded - reported_.folded);
    server_.drops_.count(side, "packets lost", now.lost - reported_.lost);
    reported_ = now;
  }

 private:
  void opened() {
    if (!refused_.empty()) socket_->refuse({Error::Cause::invalid, refused_});
  }

  Status received(Frame frame) {
    if (frame.kind == FrameKind::duplicate) {  // its sender could not listen on this address
      server_.on_duplicate_node(
          {reinterpret_cast<const char*>(frame.payload.data()), frame.payload.size()});
      return {};
    }
    if (frame.kind == FrameKind::hello) return greeted(frame.payload);
    if (node_.empty()) return Error{Error::Cause::corrupt, "no greeting"};
    if (frame.kind == FrameKind::request) return asked(std::move(frame));
    server_.set_subscribed(node_, shared_from_this(), frame.kind == FrameKind::subscribe);
    return {};
  }

  Status greeted(const std::vector<std::byte>& payload) {
    const std::string text(reinterpret_cast<const char*>(payload.data()), payload.size());
    if (!node_.empty() || !text.starts_with(kHello))
      return Error{Error::Cause::corrupt, "wrong greeting"};
    const std::string node = text.substr(kHello.size());
    if (!server_.is_local(node))
      return Error{Error::Cause::not_found, "asks for a node that is not here"};
    node_ = node;
    if (slot_) slot_->pin();
    hello_timer_.cancel();
    return {};
  }

  Status asked(Frame frame) {
    const bool wants_answer = frame.id != 0;
    if (wants_answer &&
        (answers_.size() >= kAnswersWaiting || answer_bytes_ >= kAnswerBytesWaiting)) {
      server_.drops_.count("receiver " + peer_ + " of " + node_,
                           "asks again before it reads the answers");
      return {};
    }
    Message answer = answer_from(server_.answers_, node_, frame.payload);
    if (!answer || !wants_answer) return {};
    answer_bytes_ += answer->size();
    answers_.push_back({FrameKind::answer, frame.id, std::move(answer)});
    socket_->wake();
    return {};
  }

  std::optional<OutFrame> next() {
    if (!answers_.empty()) {
      OutFrame frame = std::move(answers_.front());
      answers_.pop_front();
      answer_bytes_ -= frame.payload->size();
      return frame;
    }
    Message packet = outbox_.try_pop();
    if (!packet) return std::nullopt;
    return OutFrame{FrameKind::packet, 0, std::move(packet)};
  }

  void ended(const Error& why) {
    hello_timer_.cancel();
    slot_.reset();
    if (why.cause != Error::Cause::io && why.cause != Error::Cause::empty) {
      server_.drops_.count("peer " + peer_, why.message);
      server_.log_lines_.log("peer " + peer_ + ": " + why.message,
                             std::chrono::steady_clock::now());
    }
    if (!node_.empty()) report_drops();
    server_.ended(shared_from_this());
  }

  TcpServer& server_;
  const std::string peer_;  ///< address or network
  std::shared_ptr<ConnectionQuota::Slot> slot_;
  std::string refused_;  ///< reason; empty: not refused
  std::string node_;     ///< named in its hello; set before it can subscribe
  asio::steady_timer hello_timer_;
  std::shared_ptr<FrameSocket> socket_;
  Outbox outbox_;
  std::deque<OutFrame> answers_;
  std::size_t answer_bytes_ = 0;
  std::mutex reported_mutex_;
  Outbox::Counts reported_;
};

/// Listens at one address until destroyed.
class TcpListener {
 public:
  TcpListener(TcpServer& server, Address address)
      : server_(server),
        address_(std::move(address)),
        resolver_(server.io_),
        acceptor_(server.io_),
        timer_(server.io_) {
    resolve();
  }

 private:
  void resolve() {
    resolver_.async_resolve(address_.host, address_.port, tcp::resolver::passive,
                            [this](const auto& error, const auto& endpoints) {
                              if (error == asio::error::operation_aborted) return;
                              auto why = error;
                              if (!error) why = listen_on_any(endpoints);
                              why ? listen_later(why) : listening();
                            });
  }

  boost::system::error_code listen_on_any(const tcp::resolver::results_type& endpoints) {
    boost::system::error_code error = asio::error::host_not_found;
    for (const auto& entry : endpoints) {
      error = listen(entry.endpoint());
      if (!error) break;
    }
    return error;
  }

  boost::system::error_code listen(const tcp::endpoint& endpoint) {
    boost::system::error_code error;
    acceptor_.close(error);
    acceptor_.open(endpoint.protocol(), error);
    if (!error) acceptor_.set_option(tcp::acceptor::reuse_address(true), error);
    if (!error) acceptor_.bind(endpoint, error);
    if (!error) acceptor_.listen(tcp::acceptor::max_listen_connections, error);
    return error;
  }

  void listen_later(const boost::system::error_code& why) {
    if (!std::exchange(logged_, true)) {
      const bool in_use = why == asio::error::address_in_use;
      server_.log(
          "cannot listen on " + to_string(address_) + ": " + why.message() +
          (in_use ? "; the node may be running already: stop one of the programs, or" : ";") +
          " free the address or change it in the scene file; trying on");
      if (in_use) server_.notify_first_program(address_);
    }
    timer_.expires_after(kListenAgain);
    timer_.async_wait([this](const auto& error) {
      if (!error) resolve();
    });
  }

  void listening() {
    if (logged_) server_.log("listening on " + to_string(address_) + " now");
    accept();
  }

  void accept() {
    acceptor_.async_accept([this](const auto& error, tcp::socket socket) {
      if (error == asio::error::operation_aborted) return;
      if (!error) {
        server_.accepted(std::move(socket));
        return accept();
      }
      server_.drops_.count("listener " + to_string(address_), error.message());
      timer_.expires_after(kTcpAcceptAgain);  // for example, out of file descriptors
      timer_.async_wait([this](const auto& cancelled) {
        if (!cancelled) accept();
      });
    });
  }

  TcpServer& server_;
  const Address address_;
  tcp::resolver resolver_;
  tcp::acceptor acceptor_;
  asio::steady_timer timer_;
  bool logged_ = false;
};

/// Notifies the program that occupies our address that this program runs the same node. Keeps
/// itself alive until the notice is sent.
class DuplicateNodeNotice : public std::enable_shared_from_this<DuplicateNodeNotice> {
 public:
  DuplicateNodeNotice(asio::io_context& io, std::vector<std::string> nodes,
                      std::shared_ptr<TcpSecret> secret)
      : resolver_(io),
        socket_(io),
        timer_(io),
        nodes_(std::move(nodes)),
        secret_(std::move(secret)) {}

  void start(const Address& address) {
    resolver_.async_resolve(
        address.host, address.port, [self = shared_from_this()](const auto& error, const auto& to) {
          if (error) return;
          asio::async_connect(self->socket_, to, [self](const auto& refused, const auto&) {
            if (!refused) self->send_notice();
          });
        });
  }

 private:
  void send_notice() {
    const auto frames = std::make_shared<FrameSocket>(
        std::move(socket_), FrameSocket::Side::connects, secret_,
        FrameLimits{{FrameKind::refusal, kLongestRefusal}},
        FrameSocket::Handlers{
            [](const Frame&) { return Status(); },
            [self = shared_from_this()] { return self->next(); },
            [self = shared_from_this()](const Error&) { self->timer_.cancel(); }});
    frames_ = frames;
    timer_.expires_after(kHelloPatience);
    timer_.async_wait([self = shared_from_this()](const auto& error) {
      if (!error) self->end();
    });
    frames->start();
  }

  std::optional<OutFrame> next() {
    if (nodes_.empty()) {
      end();
      return std::nullopt;
    }
    const auto bytes = std::as_bytes(std::span(nodes_.back()));
    OutFrame frame{FrameKind::duplicate, 0,
                   std::make_shared<const std::vector<std::byte>>(bytes.begin(), bytes.end())};
    nodes_.pop_back();
    return frame;
  }

  void end() {
    if (const auto frames = frames_.lock()) frames->end({Error::Cause::empty, "told"});
  }

  tcp::resolver resolver_;
  tcp::socket socket_;
  asio::steady_timer timer_;
  std::vector<std::string> nodes_;
  const std::shared_ptr<TcpSecret> secret_;
  std::weak_ptr<FrameSocket> frames_;
};

TcpServer::TcpServer(asio::io_context& io, const AnswerRegistry& answers, Coalesce coalesce,
                     const TransportLimits& limits, Drops& drops, std::shared_ptr<TcpSecret> secret)
    : io_(io),
      answers_(answers),
      coalesce_(std::move(coalesce)),
      limits_(limits),
      drops_(drops),
      secret_(std::move(secret)),
      log_lines_(limits.log),
      quota_({limits.connections, limits.connections_per_address}) {}

TcpServer::~TcpServer() = default;

void TcpServer::announce(const std::string& node, const Address& address) {
  {
    const std::lock_guard lock(mutex_);
    if (!local_.insert(node).second) return;
  }
  asio::post(io_, [this, address] {
    auto& listener = listeners_[to_string(address)];
    if (!listener) listener = std::make_unique<TcpListener>(*this, address);
  });
}

void TcpServer::publish(const std::string& node, const Message& packet) {
  std::vector<std::shared_ptr<TcpSession>> sessions;
  {
    const std::lock_guard lock(mutex_);
    const auto at = subscribed_.find(node);
    if (at != subscribed_.end()) sessions.assign(at->second.begin(), at->second.end());
  }
  for (const auto& session : sessions) session->push(packet);
}

void TcpServer::report_drops() const {
  const std::lock_guard lock(mutex_);
  for (const auto& [node, sessions] : subscribed_)
    for (const auto& session : sessions) session->report_drops();
}

void TcpServer::accepted(tcp::socket socket) {
  boost::system::error_code error;
  const std::string peer = peer_of(socket.remote_endpoint(error).address());
  const auto session = std::make_shared<TcpSession>(*this, peer);
  auto slot = quota_.acquire(peer, [weak = std::weak_ptr(session)] {
    if (const auto self = weak.lock()) self->replace();
  });
  if (!slot && sessions_.size() >= static_cast<std::size_t>(limits_.connections) + kRefusing)
    return drops_.count("peer " + peer, "too many connections");
  sessions_.push_back(session);
  session->start(std::move(socket), std::move(slot));
}

void TcpServer::on_duplicate_node(const std::string& node) {
  if (!is_local(node)) return;
  drops_.count("node " + node, kDuplicateNodeCause);
  log_lines_.log(duplicate_node_line(node), std::chrono::steady_clock::now());
}

void TcpServer::notify_first_program(const Address& address) {
  std::make_shared<DuplicateNodeNotice>(io_, local_nodes(), secret_)->start(address);
}

std::vector<std::string> TcpServer::local_nodes() const {
  const std::lock_guard lock(mutex_);
  return {local_.begin(), local_.end()};
}

void TcpServer::ended(const std::shared_ptr<TcpSession>& session) {
  std::erase(sessions_, session);
  const std::lock_guard lock(mutex_);
  for (auto& [node, sessions] : subscribed_) sessions.erase(session);
}

bool TcpServer::is_local(const std::string& node) const {
  const std::lock_guard lock(mutex_);
  return local_.contains(node);
}

void TcpServer::set_subscribed(const std::string& node, const std::shared_ptr<TcpSession>& session,
                               bool on) {
  const std::lock_guard lock(mutex_);
  if (on)
    subscribed_[node].insert(session);
  else
    subscribed_[node].erase(session);
}

void TcpServer::log(const std::string& line) const {
  if (limits_.log) limits_.log(line);
}

}  // namespace mr::net
