#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "mr/core/trace.h"
#include "mr/net/transport.h"
#include "mr/node/node_clock.h"
#include "mr/node/task.h"

namespace mr::runtime {

/// A node's port on the scene's network, used by all executors: queues the packets of the node's
/// inputs and the answers to its requests until the executor takes them; sends the node's requests
/// and packets; forwards consumers' requests. The transport's callbacks only push to queues. take()
/// is for one thread, the rest for any thread.
class Port {
 public:
  struct Config {
    std::string id;                   ///< the node's
    std::vector<std::string> inputs;  ///< nodes to whose packets it subscribes
    net::Coalesce fold;               ///< folds waiting packets; empty: delivered one by one
    node::Clock clock;                ///< stamps answers
    std::function<void()> wake;  ///< called when something arrived; may be empty, must not wait
  };
  /// The node's answer to a request; empty: none. Any thread.
  using Answering = std::function<node::Task::Bytes(const codec::Control& request, TimePoint now)>;

  /// The transport must outlive the port.
  Port(net::Transport& transport, Config config);

  /// Starts to answer requests to the node, or to another name of it; the port itself answers
  /// requests for the time. Invalid requests are counted in `drops`, which must outlive the port.
  void serve(Answering answering, DropCounter& drops) {
    serve(config_.id, std::move(answering), drops);
  }
  void serve(const std::string& name, Answering answering, DropCounter& drops);

  /// Takes everything that has arrived since the last call.
  node::Arrivals take();
  void send(const std::vector<node::Ask>& asks);
  void publish(net::Message packet) { publish(config_.id, std::move(packet)); }
  void publish(const std::string& name, net::Message packet) {
    transport_.publish(name, std::move(packet));
  }

  /// Packets that were folded or lost because the node is slow, by cause.
  std::map<std::string, std::uint64_t> drops() const;

 private:
  struct Inbox;
  net::Transport& transport_;
  Config config_;
  std::vector<std::shared_ptr<Inbox>> inboxes_;  ///< by input; late answers may outlive the port
  std::vector<std::unique_ptr<net::Subscription>>
      subscriptions_;  // last: they use the members above
};

}  // namespace mr::runtime
