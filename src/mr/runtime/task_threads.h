#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "mr/node/node_clock.h"
#include "mr/node/request_limits.h"
#include "mr/node/task.h"
#include "mr/runtime/flow.h"
#include "mr/runtime/port.h"

namespace mr::runtime {

/// The live executor: runs one node's task on two threads until it is destroyed. The first thread
/// receives messages, sends requests to the inputs and runs the first stage of packets; the second
/// thread runs the second stage and sends packets. Each has a task arena of its own.
class TaskThreads {
 public:
  struct Config {
    node::Clock clock = node::wall_time;
    int threads = 0;              ///< of each arena; 0: all cores
    int packets_ahead = 2;        ///< begun and not yet acknowledged
    bool shares_machine = false;  ///< with its inputs: late acknowledgement
    bool gives_way = false;       ///< low priority, for nodes nearer to the root
    bool makes_packets = true;    ///< false: no second thread
    bool folds = true;            ///< waiting packets are folded into one
    Duration longest_wait = std::chrono::milliseconds(20);  ///< between two steps
    std::function<void()> ended = [] {};  ///< called on the first thread after the last packet
  };

  /// The transport must outlive this.
  TaskThreads(std::unique_ptr<node::Task> task, net::Transport& transport, node::NodeLog log,
              Config config);

  const node::Task& task() const { return *task_; }
  node::NodeStats stats() const;

 private:
  Port::Config port_config(bool folds);
  node::Task::Bytes answer(const codec::Control& request, TimePoint now);
  node::Task::Bytes answer_rung(std::size_t rung, const codec::Control& request, TimePoint now);
  void give_way() const;
  void run_first_half(const std::stop_token& stop);
  bool hand_over(const std::stop_token& stop, std::unique_ptr<node::Task::Work> work);
  void run_second_half(const std::stop_token& stop);
  void finish(node::Task::Work& work);
  void finish_rungs(node::Task::Work& work);
  Duration busy_for(TimePoint now) const;

  Config config_;
  std::unique_ptr<node::Task> task_;
  std::shared_ptr<Signal> signal_ = std::make_shared<Signal>();  // late answers may outlive this
  DropCounter drops_;
  Credit credit_;
  std::vector<std::string> rungs_;
  node::RequestLimits limits_;
  std::vector<std::unique_ptr<node::RequestLimits>> rung_limits_;  ///< as rungs_
  Port port_;
  Handoff<std::unique_ptr<node::Task::Work>> begun_;
  std::atomic<std::int64_t> busy_since_ns_ = 0, busy_ns_ = 0;  // 0: not busy
  std::atomic<std::uint64_t> packets_ = 0, bytes_ = 0;
  std::jthread first_, second_;  // last: they use the members above
};

}  // namespace mr::runtime
