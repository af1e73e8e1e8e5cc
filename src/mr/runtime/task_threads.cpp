#include "mr/runtime/task_threads.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/node/coalesce_packets.h"

namespace mr::runtime {

TaskThreads::TaskThreads(std::unique_ptr<node::Task> task, net::Transport& transport,
                         node::NodeLog log, Config config)
    : config_(std::move(config)),
      task_(std::move(task)),
      credit_(config_.packets_ahead),
      rungs_(task_->rungs()),
      port_(transport, port_config(config_.folds)) {
  drops_.set_listener(std::move(log.dropped));
  task_->wake_by([signal = signal_] { signal->notify(); });
  if (config_.makes_packets)
    port_.serve(
        [this](const codec::Control& request, TimePoint now) { return answer(request, now); },
        drops_);
  for (std::size_t i = 0; i < rungs_.size(); ++i)
    rung_limits_.push_back(std::make_unique<node::RequestLimits>());
  for (std::size_t i = 0; i < rungs_.size(); ++i)
    port_.serve(
        rungs_[i],
        [this, i](const codec::Control& request, TimePoint now) {
          return answer_rung(i, request, now);
        },
        drops_);
  first_ = std::jthread([this](const std::stop_token& stop) { run_first_half(stop); });
  if (config_.makes_packets)
    second_ = std::jthread([this](const std::stop_token& stop) { run_second_half(stop); });
}

Port::Config TaskThreads::port_config(bool folds) {
  return {.id = task_->id(),
          .inputs = task_->inputs(),
          .fold = folds ? net::Coalesce(node::coalesce_packets) : net::Coalesce(),
          .clock = config_.clock,
          .wake = [signal = signal_] { signal->notify(); }};
}

/// Credits acknowledgements; requests above the rate limits are refused.
node::Task::Bytes TaskThreads::answer(const codec::Control& request, TimePoint now) {
  if (request.taken) credit_.taken(*request.taken);
  auto bytes = task_->answer(limits_.admit(request, now), now);
  limits_.answered(bytes.size());
  signal_->notify();
  return bytes;
}

node::Task::Bytes TaskThreads::answer_rung(std::size_t rung, const codec::Control& request,
                                           TimePoint now) {
  node::RequestLimits& limits = *rung_limits_[rung];
  auto bytes = task_->answer_rung(rung, limits.admit(request, now), now);
  limits.answered(bytes.size());
  return bytes;
}

/// Lowers this thread's priority, so that mergers on the same machine run before sensors' next
/// frames.
void TaskThreads::give_way() const {
  constexpr int kNice = 5;
  if (config_.gives_way) ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
}

void TaskThreads::run_first_half(const std::stop_token& stop) {
  give_way();
  Arena arena(config_.threads);
  while (!stop.stop_requested()) {
    TimePoint now = config_.clock();
    node::Arrivals arrivals = port_.take();
    arrivals.busy = busy_for(now);
    arena.run([&] { port_.send(task_->step(arrivals, now)); });
    now = config_.clock();
    const bool is_ready = task_->is_ready(now), may_begin = is_ready && credit_.try_begin(now);
    if (may_begin) {
      std::unique_ptr<node::Task::Work> work;
      arena.run([&] { work = task_->begin(now); });
      if (!hand_over(stop, std::move(work))) return;
    }
    // A task that waits for credit is woken by the acknowledgement.
    const auto due = is_ready && !may_begin ? std::nullopt : task_->due();
    constexpr Duration kShortest = std::chrono::microseconds(100);
    signal_->wait(stop, due ? std::clamp(*due - config_.clock(), kShortest, config_.longest_wait)
                            : config_.longest_wait);
  }
}

/// False: no more packets will follow.
bool TaskThreads::hand_over(const std::stop_token& stop, std::unique_ptr<node::Task::Work> work) {
  if (work) {
    if (!config_.shares_machine) port_.send(task_->taken(*work));
    return begun_.put(stop, std::move(work));
  }
  credit_.end(false);
  if (task_->has_ended()) config_.ended();
  return !task_->has_ended();
}

void TaskThreads::run_second_half(const std::stop_token& stop) {
  give_way();
  Arena arena(config_.threads);
  while (const auto work = begun_.take(stop)) {
    const TimePoint began = config_.clock();
    busy_since_ns_ = began.time_since_epoch().count();
    arena.run([&] { finish(**work); });
    busy_since_ns_ = 0;
    busy_ns_ = (config_.clock() - began).count();
    signal_->notify();
  }
}

void TaskThreads::finish(node::Task::Work& work) {
  // On a shared machine, acknowledging early would start the inputs' next frames, which would slow
  // this stage down.
  bool is_told = !config_.shares_machine;
  const auto tell_inputs = [&] {
    if (!std::exchange(is_told, true)) port_.send(task_->taken(work));
  };
  auto bytes = task_->finish(work, tell_inputs);
  tell_inputs();
  credit_.end(bytes.has_value());
  if (bytes) {
    ++packets_;
    bytes_ += bytes->size();
    port_.publish(std::make_shared<const node::Task::Bytes>(*std::move(bytes)));
  }
  finish_rungs(work);
}

void TaskThreads::finish_rungs(node::Task::Work& work) {
  if (rungs_.empty()) return;
  for (auto& [rung, bytes] : task_->finish_rungs(work, config_.clock()))
    port_.publish(rungs_[rung], net::as_message(std::move(bytes)));
}

/// Duration of the last second stage, or of the current one so far if longer.
Duration TaskThreads::busy_for(TimePoint now) const {
  const Duration last(busy_ns_.load());
  const std::int64_t since = busy_since_ns_;
  return since == 0 ? last : std::max(last, now - TimePoint(Duration(since)));
}

node::NodeStats TaskThreads::stats() const {
  node::NodeStats out = task_->stats(config_.clock());
  if (config_.makes_packets) out.frames = packets_, out.bytes = bytes_;
  for (const auto& more : {drops_.by_cause(), port_.drops()})
    for (const auto& [cause, n] : more) out.drops[cause] += n;
  const auto add_refused = [&](const std::string& name, std::uint64_t refused) {
    if (refused > 0) out.drops["requests to " + name + ": too soon after others"] = refused;
  };
  add_refused(task_->id(), limits_.refused());
  for (std::size_t i = 0; i < rungs_.size(); ++i)
    add_refused(rungs_[i], rung_limits_[i]->refused());
  return out;
}

}  // namespace mr::runtime
