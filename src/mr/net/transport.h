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

/// Carries bytes between nodes and to viewers, and never looks inside them.
namespace mr::net {

/// Bytes that many receivers may share.
using Message = std::shared_ptr<const std::vector<std::byte>>;

/// Folds messages that wait for one slow receiver into one (DESIGN section 4, Queues). Takes them
/// oldest first, at least one; null when they cannot be folded, they are then lost.
using Coalesce = std::function<Message(std::span<const Message>)>;

/// Ends what it stands for when destroyed; no callback of it runs after that.
class Subscription {
 public:
  virtual ~Subscription() = default;
};

/// How the nodes of one scene reach each other: one packet stream and one request service per
/// node. Implementations: in one process, plain TCP, NATS. Callbacks run on the transport's
/// threads: they must only push to a queue or look something up, and never wait. Connections that
/// break are made again by themselves, for ever. Thread-safe.
class Transport {
 public:
  virtual ~Transport() = default;

  /// Sends a packet of `node` to all that subscribed to it. Never waits: what a slow receiver
  /// cannot take is coalesced, and counted when lost.
  virtual void publish(const std::string& node, Message packet) = 0;

  /// Packets of `node`, from now on; it need not exist yet.
  virtual std::unique_ptr<Subscription> subscribe(const std::string& node,
                                                  std::function<void(Message)> on_packet) = 0;

  /// Asks `node` something. The answer comes later, or never (node away, answer null).
  virtual void request(const std::string& node, Message question,
                       std::function<void(Message)> on_answer) = 0;

  /// Answers requests made to `node`; a null answer is not sent.
  virtual std::unique_ptr<Subscription> serve(
      const std::string& node, std::function<Message(std::span<const std::byte>)> answer) = 0;

  /// What was lost since the start, by "<slow or broken side>: <cause>".
  virtual std::map<std::string, std::uint64_t> drops() const = 0;
};

/// Caps of every transport. A peer that sends more is disconnected and counted.
struct TransportLimits {
  std::size_t message_bytes = 64u << 20;   ///< NATS: what the server's max_payload allows
  std::size_t queue_messages = 30;         ///< waiting for one receiver, before they are coalesced
  std::size_t queue_bytes = 128u << 20;    ///< ... above it all that wait are lost
  int connections = 256;                   ///< that a TCP node accepts at once
};

/// All nodes in this process. Delivers on the publisher's thread.
std::unique_ptr<Transport> make_in_process_transport();

/// Plain TCP (paper 5). `addresses`: "host:port" of each node that publishes; such a node listens
/// there once it publishes or serves. io, invalid: a port in use is told by publish's log line and
/// tried again.
Result<std::unique_ptr<Transport>> make_tcp_transport(
    const std::map<std::string, std::string>& addresses, Coalesce coalesce,
    const TransportLimits& limits = {});

/// NATS: subject "mr.<scene>.<node>.packet" for packets, "mr.<scene>.<node>.ask" for requests. The
/// server may be absent, restarted or replaced at any time: one line tells so, and the client goes
/// on trying.
Result<std::unique_ptr<Transport>> make_nats_transport(const std::string& url,
                                                       const std::string& scene,
                                                       const TransportLimits& limits = {});

}  // namespace mr::net
