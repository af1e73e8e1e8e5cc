#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "mr/core/result.h"
#include "mr/net/drops.h"
#include "mr/net/network_config.h"
#include "mr/net/transport.h"

namespace mr::net {

class NatsEvents;
class NatsReceiver;

/// A message that arrived on a subject, reassembled from its fragments.
struct NatsArrival {
  std::string subject;
  std::string reply;  ///< empty: no answer is wanted
  Message message;
};

/// The connection to a NATS server or cluster, for messages of any size. It is made again for ever
/// when it breaks.
class NatsLink {
 public:
  using Handler = std::function<void(const NatsArrival&)>;

  /// Succeeds also while no server can be reached. invalid, io, not_found: the URL or a file of the
  /// config cannot be used.
  static Result<std::shared_ptr<NatsLink>> open(const NatsConfig& config,
                                                const TransportLimits& limits,
                                                std::shared_ptr<Drops> drops);
  ~NatsLink();

  /// Ends all receivers. Nothing may be sent afterwards, and no handler runs after this returns.
  void close();

  /// Subscribes `handler` to `subject` until forget(), across reconnections. Messages above
  /// `message_bytes` are dropped. Any thread.
  std::shared_ptr<NatsReceiver> receive(const std::string& subject, std::size_t message_bytes,
                                        Handler handler);
  /// Unsubscribes. After it returns, the handler does not run on another thread. Any thread.
  void forget(const std::shared_ptr<NatsReceiver>& receiver);

  /// io: there is no server. too_large: for its max_payload. One thread at a time; may wait up to
  /// two seconds for a server that does not read.
  Status send(const std::string& subject, const std::string& reply, const Message& message);

  /// Connects when there is no connection; logs once why that fails. To be called about twice a
  /// second by the thread that sends. Blocks up to two seconds on a silent server.
  void reconnect();

 private:
  struct Connection;
  NatsLink(NatsConfig config, const TransportLimits& limits, std::shared_ptr<Drops> drops);
  std::unique_ptr<Connection> connect();
  void unsubscribe(NatsReceiver& receiver);
  void unsubscribe_all();
  void subscribe(const std::shared_ptr<NatsReceiver>& receiver);

  const NatsConfig config_;
  const TransportLimits limits_;
  const std::shared_ptr<Drops> drops_;
  const std::shared_ptr<NatsEvents> events_;
  std::uint64_t last_message_;  ///< id; starts anywhere, so that no two senders use the same
  std::mutex mutex_;            ///< of all below
  std::unique_ptr<Connection> connection_;  ///< null: none
  std::set<std::shared_ptr<NatsReceiver>> receivers_;
};

}  // namespace mr::net
