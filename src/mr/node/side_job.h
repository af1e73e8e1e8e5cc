#pragma once

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <future>
#include <optional>

#include "mr/core/parallel.h"

namespace mr::node {

/// When a node works on what stays: within its tick, so that the same captures give the same bytes;
/// or, once most of the room is learnt, beside its ticks, as a SideJob.
enum class StillWork { at_once, beside };

/// One job at a time beside its owner's own work: on one thread, at low priority, so that what is
/// live goes first. Not thread-safe: one owner, who waits for the job when he ends.
template <typename T>
class SideJob {
 public:
  /// Whether a job was started and its result not taken yet.
  bool is_busy() const { return result_.valid(); }

  /// Not while one is busy. What the job uses must outlive it, and stay as it is.
  void start(std::function<T()> job) {
    result_ = std::async(std::launch::async, [job = std::move(job)] {
      constexpr int kNice = 10;
      ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
      std::optional<T> out;
      Arena(1).run([&] { out.emplace(job()); });
      return *std::move(out);
    });
  }

  /// The result, once, when it is there.
  std::optional<T> take() {
    if (!is_busy() || result_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
      return std::nullopt;
    return result_.get();
  }

 private:
  std::future<T> result_;
};

}  // namespace mr::node
