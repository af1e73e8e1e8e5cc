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

/// The connection to a NATS server or cluster, for messages of any size. A broken connection is
/// restored, without a limit of attempts.
class NatsLink {
 public:
  using Handler = std::function<void(const NatsArrival&)>;

  /// Succeeds even if no server can be reached. Errors invalid, io, not_found: the URL or a file of
  /// the config cannot be used.
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

  /// Errors: io: no connection; too_large: for the server's max_payload. One thread at a time; may
  /// block for up to two seconds on a server that does not read.
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
  std::uint64_t last_message_;  ///< id; starts at a random number, so that senders differ
  std::mutex mutex_;            ///< guards all below
  std::unique_ptr<Connection> connection_;  ///< null: none
  std::set<std::shared_ptr<NatsReceiver>> receivers_;
};

}  // namespace mr::net
