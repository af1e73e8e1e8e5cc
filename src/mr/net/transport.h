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

/// Carries bytes between nodes and to viewers, and never looks inside them.
namespace mr::net {

/// Ends what it stands for when destroyed; no callback of it runs after that. The destructor waits
/// for a callback that runs on another thread, so hold no lock that the callback takes. It may be
/// destroyed from within its own callback, and after its transport.
class Subscription {
 public:
  virtual ~Subscription() = default;
};

/// How the nodes of one scene reach each other: one packet stream and one request service per
/// node. Implementations: in one process, plain TCP, NATS. Callbacks run on the transport's
/// threads: they must only push to a queue or look something up, never wait and never throw.
/// Connections that break are made again by themselves, for ever. Thread-safe. A transport is
/// not destroyed from within a callback; no callback runs once it is.
class Transport {
 public:
  virtual ~Transport() = default;

  /// Sends a packet of `node` to all that subscribed to it. Never waits: what a slow receiver
  /// cannot take is coalesced, and counted when lost.
  virtual void publish(const std::string& node, Message packet) = 0;

  /// Packets of `node`, from now on; it need not exist yet.
  virtual std::unique_ptr<Subscription> subscribe(const std::string& node,
                                                  std::function<void(Message)> on_packet) = 0;

  /// Asks `node` something, 1 MB at most. The answer comes later (in one process: before this
  /// returns), or never (node away, answer null); after 2 s it is no longer waited for. Without
  /// `on_answer` it is a word that needs none.
  virtual void request(const std::string& node, Message message,
                       std::function<void(Message)> on_answer = {}) = 0;

  /// Answers requests made to `node`; a null answer is not sent. One service per node: of several
  /// in one transport the newest answers. Where another program serves the node, too, both tell so,
  /// in one process none.
  virtual std::unique_ptr<Subscription> serve(
      const std::string& node, std::function<Message(std::span<const std::byte>)> answer) = 0;

  /// What was lost or folded since the start, by "<slow or broken side>: <cause>".
  virtual std::map<std::string, std::uint64_t> drops() const = 0;
};

/// Largest request that request() sends.
inline constexpr std::size_t kMaxRequestBytes = 1u << 20;

/// Caps of every transport. A peer that sends more is disconnected and counted.
struct TransportLimits {
  std::size_t message_bytes = 64u << 20;  ///< largest packet or answer
  std::size_t queue_messages = 30;        ///< waiting for one receiver, before they are coalesced
  std::size_t queue_bytes = 128u << 20;   ///< ... above it all that wait are lost
  int connections = 256;                  ///< that a TCP node accepts at once; above it, and ...
  int connections_per_address = 32;       ///< ... from one IP address, the newest replaces the one
                                          ///< that has not greeted for longest; else it is refused
  /// One line each time a peer, port or server goes or comes. Runs on any thread; must not wait.
  std::function<void(const std::string&)> log = nullptr;
};

/// All nodes in this process. Delivers on the publisher's thread.
std::unique_ptr<Transport> make_in_process_transport();

/// Plain TCP (paper 5). `addresses`: "host:port" of each node, "[v6]:port" for IPv6; a node listens
/// there once it publishes or serves. `secret`: 16 characters or more that all nodes share;
/// connections are encrypted then, and whoever does not know it is refused. Empty: plain
/// connections, open to everybody who reaches them. invalid: addresses that cannot be read, all in
/// one message; a short secret. A port in use is logged and tried again each second.
Result<std::unique_ptr<Transport>> make_tcp_transport(
    const std::map<std::string, std::string>& addresses, Coalesce coalesce,
    const TransportLimits& limits = {}, const std::string& secret = {});

/// NATS: subject "mr.<scene>.<node>.packet" for packets, "mr.<scene>.<node>.ask" for requests,
/// whose answers come to "_INBOX.mr.<scene>.…", and "mr.<scene>.<node>.here", where a program that
/// serves a node says so each second. `config.url`: "nats://host:port", "tls://…", with
/// "user:password@" or "token@" before the host; several after commas: of a cluster name every
/// server. The server may be absent, restarted or replaced at any time, or refuse us: one line says
/// why, and the client goes on trying. Works with any max_payload: larger messages travel in parts.
/// `coalesce` folds what waits while the server is slow; without it that is lost. An error: the
/// URL, a file that `config` names or a name cannot be used.
Result<std::unique_ptr<Transport>> make_nats_transport(const NatsConfig& config,
                                                       const std::string& scene,
                                                       const TransportLimits& limits = {},
                                                       Coalesce coalesce = {});

}  // namespace mr::net
