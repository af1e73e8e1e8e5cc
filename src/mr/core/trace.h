#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "mr/core/result.h"

namespace mr {

/// Adds the time of a scope to a sum.
class Stopwatch {
 public:
  explicit Stopwatch(double& sum_ms) : sum_ms_(sum_ms) {}
  ~Stopwatch() {
    const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - start_;
    sum_ms_ += ms.count();
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  double& sum_ms_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Processor time of this process so far, on all its threads.
double process_cpu_ms();

/// Milliseconds that each stage of a node took, one entry per frame in which it ran; the newest
/// `kKept` of each. Thread-safe.
class Trace {
 public:
  static constexpr std::size_t kKept = 4096;

  void add(const std::string& stage, double ms);
  /// Oldest first.
  std::map<std::string, std::vector<double>> stages() const;

  /// Runs `work` and notes its time under `stage`; returns what it returns.
  template <typename Work>
  auto time(const std::string& stage, Work&& work) {
    const Timer timer(*this, stage);
    return work();
  }

 private:
  struct Timer {
    Timer(Trace& t, const std::string& s) : trace(t), stage(s) {}
    ~Timer() {
      const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - start;
      trace.add(stage, ms.count());
    }
    Timer(const Timer&) = delete;
    Timer& operator=(const Timer&) = delete;
    Trace& trace;
    const std::string& stage;
    std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  };

  struct Ring {
    std::vector<double> ms;
    std::size_t next = 0;  ///< the oldest, once it is full
  };
  mutable std::mutex mutex_;
  std::map<std::string, Ring> stages_;
};

/// The p-th percentile (0..1) by linear interpolation; 0 for no samples.
double percentile(std::vector<double> samples, double p);

/// What was dropped, counted by cause. Each cause is "<place>: <cause>". Thread-safe.
class DropCounter {
 public:
  using Listener = std::function<void(const std::string& place, const Error& error)>;

  /// Called for every drop that is news, under no lock. Set before the first one.
  void set_listener(Listener listener) { listener_ = std::move(listener); }

  /// `is_news`: the listener is told; else it is counted alone, as the same was told before.
  void count(const std::string& place, const Error& error, bool is_news = true) {
    {
      const std::lock_guard lock(mutex_);
      ++by_cause_[place + ": " + cause_name(error.cause)];
    }
    if (is_news && listener_) listener_(place, error);
  }
  std::map<std::string, std::uint64_t> by_cause() const {
    const std::lock_guard lock(mutex_);
    return by_cause_;
  }
  std::uint64_t total() const {
    std::uint64_t sum = 0;
    for (const auto& [cause, n] : by_cause()) sum += n;
    return sum;
  }

 private:
  Listener listener_;
  mutable std::mutex mutex_;
  std::map<std::string, std::uint64_t> by_cause_;
};

}  // namespace mr
