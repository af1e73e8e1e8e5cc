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

/// What came in on a subject, put together again.
struct NatsArrival {
  std::string subject;
  std::string reply;  ///< empty: no answer is wanted
  Message message;
};

/// The connection to a NATS server (or a cluster), for ever made again; messages of any size.
class NatsLink {
 public:
  using Handler = std::function<void(const NatsArrival&)>;

  /// No server need be there. invalid, io, not_found: the URL or a file cannot be used.
  static Result<std::shared_ptr<NatsLink>> open(const NatsConfig& config,
                                                const TransportLimits& limits,
                                                std::shared_ptr<Drops> drops);
  ~NatsLink();

  /// Ends all receivers, once nothing is sent any more: no handler runs after this.
  void close();

  /// Messages on `subject`, none larger than `message_bytes`, until forget(). Any thread.
  std::shared_ptr<NatsReceiver> receive(const std::string& subject, std::size_t message_bytes,
                                        Handler handler);
  /// No handler runs on another thread after this. Any thread.
  void forget(const std::shared_ptr<NatsReceiver>& receiver);

  /// io: there is no server. too_large: for its max_payload. One thread at a time; may wait up to
  /// two seconds for a server that does not read.
  Status send(const std::string& subject, const std::string& reply, const Message& message);

  /// Connects anew where there is no connection, and tells why that fails, once. To be called about
  /// twice a second, by the thread that sends; waits up to two seconds for a server that is silent.
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
