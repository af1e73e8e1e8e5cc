#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "child.h"

namespace mr::bench {

/// Lap timer: assigns parts of a run's time to stages. Starts when constructed.
class StageClock {
 public:
  /// Assigns the time since the last lap, or the start, to `stage`.
  void lap(const std::string& stage);
  void skip();                                           ///< discards the time since the last lap
  void add(const std::string& stage, double ms);         ///< measured elsewhere
  const Message& stage_ms() const { return stage_ms_; }  ///< by stage, in order

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_ = Clock::now();
  Message stage_ms_ = Message::object();
};

/// One implementation, running in its own process.
class Work {
 public:
  virtual ~Work() = default;
  /// Frees the last result; not timed.
  virtual void clear() = 0;
  /// One run; timed.
  virtual void run(StageClock& clock) = 0;
  /// The result of the last run.
  virtual Message result() = 0;
};

struct Contender {
  std::string impl;
  int threads = 1;
  Message about = Message::object();  ///< additional fields of its results, such as a block size
  std::function<std::unique_ptr<Work>()> make;  ///< called in the child: threads start here
};

struct RaceConfig {
  int warm_ups = 2;
  int runs = 11;  ///< of each contender; 3 if every warm-up took over 2 s
  std::chrono::seconds patience{120};
  bool wants_results = true;
  bool quiet = false;  ///< discards the contenders' output
};

/// The measurements of one contender. Times are per run, without the warm-up.
struct Outcome {
  std::vector<double> ms, cpu_ms;  ///< cpu_ms: of all its threads
  std::vector<std::pair<std::string, std::vector<double>>> stage_ms;  ///< in order
  double peak_mb = 0;   ///< peak memory minus memory before the first run; without code
  std::string aborted;  ///< reason of an abort; empty: it finished
  Message result;       ///< null: aborted, or not requested

  bool usable() const { return !ms.empty(); }
};

double median(std::vector<double> values);
/// The 95th percentile by nearest rank.
double percentile95(std::vector<double> values);

/// Runs contenders alternately, each in its own process forked before the first run, so that all
/// are subject to the same fluctuations of the machine. A contender that dies drops out. `progress`
/// is called with the number of finished runs and of all.
std::vector<Outcome> race(const std::vector<Contender>& contenders, const RaceConfig& config,
                          const std::function<void(std::size_t, std::size_t)>& progress = {});

/// The fields of a result that every stage has: impl, threads, case, ms, p95_ms, cpu_ms, runs,
/// stages, peak_mb, the contender's own fields, and `aborted` if it was.
Message result_row(const Contender& contender, const std::string& case_name,
                   const Outcome& outcome);

}  // namespace mr::bench
