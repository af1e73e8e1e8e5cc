#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <utility>

#include "mr/net/io_thread.h"
#include "mr/net/tcp_link.h"
#include "mr/net/tcp_secret.h"
#include "mr/net/tcp_server.h"
#include "mr/net/transport.h"

namespace mr::net {
namespace asio = boost::asio;

namespace {

constexpr std::chrono::milliseconds kTcpTick{500};

class TcpTransport final : public Transport {
 public:
  TcpTransport(const std::map<std::string, Address>& addresses, Coalesce coalesce,
               const TransportLimits& limits, const std::shared_ptr<TcpSecret>& secret)
      : thread_(limits.log),
        addresses_(addresses),
        limits_(limits),
        server_(thread_.io(), answers_, std::move(coalesce), limits, drops_, secret),
        ticker_(thread_.io()) {
    for (const auto& [node, address] : addresses_)
      links_[node] =
          std::make_unique<TcpLink>(thread_.io(), node, address, packets_, limits, drops_, secret);
    tick();
    thread_.start();
  }
  ~TcpTransport() override { thread_.stop(); }
  TcpTransport(const TcpTransport&) = delete;
  TcpTransport& operator=(const TcpTransport&) = delete;

  void publish(const std::string& node, Message packet) override {
    if (!packet || !announce(node)) return;
    if (packet->size() > limits_.message_bytes)
      drops_.count("node " + node, "packet too large");
    else
      server_.publish(node, packet);
  }

  std::unique_ptr<Subscription> subscribe(const std::string& node,
                                          std::function<void(Message)> on_packet) override {
    auto subscription = packets_.add(node, std::move(on_packet));
    if (TcpLink* link = find_link(node)) asio::post(thread_.io(), [link] { link->wake(); });
    return subscription;
  }

  void request(const std::string& node, Message message,
               std::function<void(Message)> on_answer) override {
    TcpLink* link = find_link(node);
    if (!message || !link) return;
    link->request(std::move(message), std::move(on_answer));
    asio::post(thread_.io(), [link] { link->wake(); });
  }

  std::unique_ptr<Subscription> serve(
      const std::string& node, std::function<Message(std::span<const std::byte>)> answer) override {
    auto subscription = answers_.add(node, std::move(answer));
    announce(node);
    return subscription;
  }

  std::map<std::string, std::uint64_t> drops() const override {
    server_.report_drops();
    return drops_.all();
  }

 private:
  bool announce(const std::string& node) {
    const auto at = addresses_.find(node);
    if (at == addresses_.end()) {
      drops_.count("node " + node, "has no address");
      return false;
    }
    server_.announce(node, at->second);
    return true;
  }

  TcpLink* find_link(const std::string& node) {
    const auto at = links_.find(node);
    if (at != links_.end()) return at->second.get();
    drops_.count("node " + node, "has no address");
    return nullptr;
  }

  void tick() {
    for (const auto& [node, link] : links_) link->tick();
    ticker_.expires_after(kTcpTick);
    ticker_.async_wait([this](const auto& error) {
      if (!error) tick();
    });
  }

  IoThread thread_;  // first: everything below lives on it
  const std::map<std::string, Address> addresses_;
  const TransportLimits limits_;
  Drops drops_;
  PacketRegistry packets_;
  AnswerRegistry answers_;
  TcpServer server_;
  std::map<std::string, std::unique_ptr<TcpLink>> links_;  ///< as addresses_
  asio::steady_timer ticker_;
};

}  // namespace

Result<std::unique_ptr<Transport>> make_tcp_transport(
    const std::map<std::string, std::string>& addresses, Coalesce coalesce,
    const TransportLimits& limits, const std::string& secret) {
  std::map<std::string, Address> parsed;
  std::string problems;
  for (const auto& [node, text] : addresses) {
    auto address = parse_address(text);
    if (address && !node.empty() && node.size() <= kLongestName)
      parsed.emplace(node, std::move(*address));
    else
      problems += (problems.empty() ? "node " : "; node ") + node + ": " +
                  (address ? "its name is empty or too long" : address.error().message);
  }
  if (!problems.empty()) return Error{Error::Cause::invalid, problems};
  std::shared_ptr<TcpSecret> shared;
  if (!secret.empty()) {
    auto made = TcpSecret::make(secret);
    if (!made) return made.error();
    shared = *std::move(made);
  }
  try {
    return std::unique_ptr<Transport>(
        std::make_unique<TcpTransport>(parsed, std::move(coalesce), limits, shared));
  } catch (const std::exception& e) {
    return Error{Error::Cause::io, std::string("TCP transport: ") + e.what()};
  }
}

}  // namespace mr::net
