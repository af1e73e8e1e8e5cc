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

/// CPU time that this process has used so far, on all its threads.
double process_cpu_ms();

/// Durations of a node's stages in milliseconds, one entry per frame in which a stage ran; the
/// newest `kKept` of each stage. Thread-safe.
class Trace {
 public:
  static constexpr std::size_t kKept = 4096;

  void add(const std::string& stage, double ms);
  /// The recorded durations by stage, oldest first.
  std::map<std::string, std::vector<double>> stages() const;

  /// Runs `work`, records its duration under `stage`, and returns its result.
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
    std::size_t next = 0;  ///< index of the oldest entry, once the ring is full
  };
  mutable std::mutex mutex_;
  std::map<std::string, Ring> stages_;
};

/// The p-th percentile (0..1) by linear interpolation; 0 for no samples.
double percentile(std::vector<double> samples, double p);

/// Counts dropped data by cause, named "<place>: <cause>". Thread-safe.
class DropCounter {
 public:
  using Listener = std::function<void(const std::string& place, const Error& error)>;

  /// The listener is called for every drop that is news, without a lock held. To be set before the
  /// first drop.
  void set_listener(Listener listener) { listener_ = std::move(listener); }

  /// `is_news`: also calls the listener. False: the same drop was already reported; only counted.
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
