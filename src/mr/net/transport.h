#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/net/network_config.h"
#include "mr/net/outbox.h"

/// Transports carry bytes between nodes and to viewers; they never interpret them.
namespace mr::net {

/// A subscription or service (RAII): its destructor ends it, and no callback runs afterwards. The
/// destructor waits for a callback that is running on another thread, so the caller must not hold a
/// lock that the callback takes. It may be destroyed within its own callback, and after its
/// transport.
class Subscription {
 public:
  virtual ~Subscription() = default;
};

/// Carries messages between the nodes of one scene: for each node a stream of packets
/// (publish/subscribe) and a service (request/response). Implementations: in one process, plain
/// TCP, NATS. Callbacks run on the transport's threads; they may push to a queue or do a
/// look-up, but must not wait or throw. Broken connections are restored automatically. Thread-safe.
/// A transport must not be destroyed within a callback; no callback runs afterwards.
class Transport {
 public:
  virtual ~Transport() = default;

  /// Sends a packet of `node` to its subscribers. Never blocks: packets that a slow subscriber
  /// cannot take are coalesced, or dropped and counted.
  virtual void publish(const std::string& node, Message packet) = 0;

  /// Subscribes to the packets of `node`, which need not exist yet.
  virtual std::unique_ptr<Subscription> subscribe(const std::string& node,
                                                  std::function<void(Message)> on_packet) = 0;

  /// Sends a request of at most kMaxRequestBytes to `node`. `on_answer` is called when the answer
  /// comes (in one process: before this returns), or never: if the node is absent, answers null or
  /// takes more than 2 s. Without `on_answer` no answer is sent.
  virtual void request(const std::string& node, Message message,
                       std::function<void(Message)> on_answer = {}) = 0;

  /// Answers the requests made to `node`; null: no answer is sent. One service per node: of several
  /// in one transport the newest answers. When another program serves the same node, both log it
  /// (not the in-process transport).
  virtual std::unique_ptr<Subscription> serve(
      const std::string& node, std::function<Message(std::span<const std::byte>)> answer) = 0;

  /// Counts of lost and coalesced messages since the start, by "<slow or broken side>: <cause>".
  virtual std::map<std::string, std::uint64_t> drops() const = 0;
};

/// The largest request that request() sends.
inline constexpr std::size_t kMaxRequestBytes = 1u << 20;

/// Limits of every transport. A peer that exceeds them is disconnected and counted.
struct TransportLimits {
  std::size_t message_bytes = 64u << 20;  ///< largest packet or answer
  std::size_t queue_messages = 30;        ///< waiting for one receiver, before they are coalesced
  std::size_t queue_bytes = 128u << 20;   ///< ... above it all waiting ones are dropped
  int connections = 256;                  ///< of a TCP node. Above it, or above ...
  int connections_per_address = 32;       ///< ... from one IP address, a new one evicts the oldest
                                          ///< without a greeting, or else is refused
  /// Called with a log line when a peer, port or server fails or returns. Any thread; must not
  /// wait.
  std::function<void(const std::string&)> log = nullptr;
};

/// For nodes in this process. Callbacks run on the publisher's thread.
std::unique_ptr<Transport> make_in_process_transport();

/// Plain TCP (paper 5). `addresses`: "host:port" of each node, "[v6]:port" for IPv6; a node listens
/// there once it publishes or serves. `secret`: at least 16 characters, shared by all nodes: the
/// pre-shared key by which connections are encrypted and authenticated. Empty: plain connections
/// without authentication. invalid: malformed addresses, all in one message, or a short secret. A
/// port in use is logged and tried again each second.
Result<std::unique_ptr<Transport>> make_tcp_transport(
    const std::map<std::string, std::string>& addresses, Coalesce coalesce,
    const TransportLimits& limits = {}, const std::string& secret = {});

/// NATS: subject "mr.<scene>.<node>.packet" for packets, "mr.<scene>.<node>.ask" for requests,
/// whose answers come to "_INBOX.mr.<scene>.…", and "mr.<scene>.<node>.here", the heartbeat that a
/// program sends each second for a node that it serves. `config.url`: "nats://host:port",
/// "tls://…", with "user:password@" or "token@" before the host; several after commas: for a
/// cluster, name every server. The server may be absent, be restarted or replaced at any time, or
/// refuse us: the reason is logged once, and the client keeps trying. Works with any max_payload:
/// larger messages are sent in fragments. `coalesce` is for packets that wait while the server is
/// slow; without it they are dropped. Errors: the URL, a file that `config` names or a node's name
/// cannot be used.
Result<std::unique_ptr<Transport>> make_nats_transport(const NatsConfig& config,
                                                       const std::string& scene,
                                                       const TransportLimits& limits = {},
                                                       Coalesce coalesce = {});

}  // namespace mr::net
