#pragma once

#include <string>
#include <vector>

#include "mr/core/trace.h"
#include "mr/net/transport.h"
#include "mr/node/node_clock.h"
#include "mr/node/task.h"
#include "mr/runtime/port.h"

namespace mr::runtime {

/// The executor in virtual time: runs one node's task step by step, on the caller's thread and at
/// the caller's times. TaskThreads is its counterpart for live nodes.
class TaskSteps {
 public:
  /// The task, the transport and `drops`, which counts invalid requests, must outlive this.
  /// `clock`: the virtual time.
  TaskSteps(node::Task& task, net::Transport& transport, node::Clock clock, DropCounter& drops);

  /// Passes arrivals to the task, then the answers to its requests that arrive at once.
  void step(TimePoint now);
  /// Makes and publishes a packet if the task is ready for one, and those of its rungs. Returns it;
  /// null: none.
  net::Message make_packet(TimePoint now);

 private:
  node::Task& task_;
  std::vector<std::string> rungs_;
  Port port_;
};

}  // namespace mr::runtime
