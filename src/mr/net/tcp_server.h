#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "mr/net/address.h"
#include "mr/net/connection_quota.h"
#include "mr/net/drops.h"
#include "mr/net/rate_limited_log.h"
#include "mr/net/registry.h"
#include "mr/net/transport.h"

namespace mr::net {

class TcpListener;
class TcpSecret;
class TcpSession;

/// The server side of the TCP transport: listens for each local node, publishes its packets to
/// subscribers and answers requests. A refused peer receives the reason, which is logged, too. The
/// io thread must have ended before this is destroyed.
class TcpServer {
 public:
  TcpServer(boost::asio::io_context& io, const AnswerRegistry& answers, Coalesce coalesce,
            const TransportLimits& limits, Drops& drops, std::shared_ptr<TcpSecret> secret);
  ~TcpServer();

  /// Starts to listen for `node`; idempotent. Any thread.
  void announce(const std::string& node, const Address& address);
  /// Any thread.
  void publish(const std::string& node, const Message& packet);
  /// Adds the counts of coalesced and lost packets so far to the drops. Any thread.
  void report_drops() const;

 private:
  friend class TcpSession;
  friend class TcpListener;

  void accepted(boost::asio::ip::tcp::socket socket);
  void on_duplicate_node(const std::string& node);
  void notify_first_program(const Address& address);
  std::vector<std::string> local_nodes() const;
  void ended(const std::shared_ptr<TcpSession>& session);
  bool is_local(const std::string& node) const;
  void set_subscribed(const std::string& node, const std::shared_ptr<TcpSession>& session, bool on);
  void log(const std::string& line) const;

  boost::asio::io_context& io_;
  const AnswerRegistry& answers_;
  const Coalesce coalesce_;
  const TransportLimits limits_;
  Drops& drops_;
  const std::shared_ptr<TcpSecret> secret_;
  RateLimitedLog log_lines_;

  std::map<std::string, std::unique_ptr<TcpListener>> listeners_;  ///< by address; io thread
  ConnectionQuota quota_;                                          ///< io thread
  std::vector<std::shared_ptr<TcpSession>> sessions_;              ///< oldest first; io thread

  mutable std::mutex mutex_;
  std::set<std::string> local_;                                              ///< nodes; by mutex_
  std::map<std::string, std::set<std::shared_ptr<TcpSession>>> subscribed_;  ///< by mutex_
};

}  // namespace mr::net
