#pragma once

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <future>
#include <optional>

#include "mr/core/parallel.h"

namespace mr::node {

/// When a node processes the still surface: at_once: within its tick, deterministically; beside: in
/// a background thread (SideJob), once most of the background is learnt.
enum class StillWork { at_once, beside };

/// A background job on one thread at low priority, so that live work has precedence; one at a time.
/// Not thread-safe: one owner. The destructor waits for the job.
template <typename T>
class SideJob {
 public:
  /// Whether a job was started and its result is not taken yet.
  bool is_busy() const { return result_.valid(); }

  /// Must not be called while a job is busy. Data that the job refers to must outlive it and not
  /// change.
  void start(std::function<T()> job) {
    result_ = std::async(std::launch::async, [job = std::move(job)] {
      constexpr int kNice = 10;
      ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
      std::optional<T> out;
      Arena(1).run([&] { out.emplace(job()); });
      return *std::move(out);
    });
  }

  /// The result, once, when the job has finished; else nothing.
  std::optional<T> take() {
    if (!is_busy() || result_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
      return std::nullopt;
    return result_.get();
  }

 private:
  std::future<T> result_;
};

}  // namespace mr::node
