#include "mr/runtime/task_steps.h"

#include <memory>
#include <utility>

#include "mr/node/coalesce_packets.h"

namespace mr::runtime {

TaskSteps::TaskSteps(node::Task& task, net::Transport& transport, node::Clock clock,
                     DropCounter& drops)
    : task_(task),
      rungs_(task.rungs()),
      port_(transport, {.id = task.id(),
                        .inputs = task.inputs(),
                        .fold = node::coalesce_packets,
                        .clock = std::move(clock),
                        .wake = {}}) {
  port_.serve(
      [this](const codec::Control& request, TimePoint now) { return task_.answer(request, now); },
      drops);
  for (std::size_t i = 0; i < rungs_.size(); ++i)
    port_.serve(
        rungs_[i],
        [this, i](const codec::Control& request, TimePoint now) {
          return task_.answer_rung(i, request, now);
        },
        drops);
}

void TaskSteps::step(TimePoint now) {
  node::Arrivals arrivals = port_.take();
  do {
    port_.send(task_.step(arrivals, now));
    arrivals = port_.take();
  } while (!arrivals.empty());
}

net::Message TaskSteps::make_packet(TimePoint now) {
  const auto work = task_.is_ready(now) ? task_.begin(now) : nullptr;
  if (!work) return nullptr;
  net::Message packet;
  if (auto bytes = task_.finish(*work, [] {})) {
    packet = net::as_message(*std::move(bytes));
    port_.publish(packet);
  }
  for (auto& [rung, bytes] : task_.finish_rungs(*work, now))
    port_.publish(rungs_[rung], net::as_message(std::move(bytes)));
  return packet;
}

}  // namespace mr::runtime
