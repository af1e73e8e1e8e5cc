#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "mr/core/trace.h"
#include "mr/net/transport.h"
#include "mr/node/node_clock.h"
#include "mr/node/task.h"

namespace mr::runtime {

/// A node's place on the scene's network, the one router of every executor: takes the packets of
/// the node's inputs and the answers to its asks, until the executor gives them to its task;
/// carries its asks and packets; passes consumers' requests on. The transport's callbacks only
/// push. take() is for one thread, the rest for any.
class Port {
 public:
  struct Config {
    std::string id;                   ///< the node's
    std::vector<std::string> inputs;  ///< nodes whose packets it takes
    net::Coalesce fold;               ///< what waits becomes one packet; empty: taken one by one
    node::Clock clock;                ///< when answers came
    std::function<void()> wake;  ///< called when something arrived; may be empty, must not wait
  };
  /// What the node says to a request; empty: nothing. Any thread.
  using Answering = std::function<node::Task::Bytes(const codec::Control& request, TimePoint now)>;

  /// The transport must outlive it.
  Port(net::Transport& transport, Config config);

  /// From now on requests to the node are answered, those for the time by the port itself. Bytes
  /// that are none are counted in `drops`, which must outlive this.
  void serve(Answering answering, DropCounter& drops);

  /// What has arrived since the last call.
  node::Arrivals take();
  void send(const std::vector<node::Ask>& asks);
  void publish(net::Message packet);

  /// Packets that were folded or lost because the node is slow.
  std::map<std::string, std::uint64_t> drops() const;

 private:
  struct Inbox;
  net::Transport& transport_;
  Config config_;
  std::vector<std::shared_ptr<Inbox>> inboxes_;  ///< by input; late answers may outlive the port
  std::vector<std::unique_ptr<net::Subscription>> subscriptions_;  // last: they use what is above
};

}  // namespace mr::runtime
