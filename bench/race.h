#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "child.h"

namespace mr::bench {

/// Names the parts of a run's time. It runs from its construction on.
class StageClock {
 public:
  /// What passed since the last lap, or the start, belongs to `stage`.
  void lap(const std::string& stage);
  void skip();                                           ///< what passed belongs to no stage
  void add(const std::string& stage, double ms);         ///< measured elsewhere
  const Message& stage_ms() const { return stage_ms_; }  ///< by stage, in order

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_ = Clock::now();
  Message stage_ms_ = Message::object();
};

/// One implementation at work in its own process.
class Work {
 public:
  virtual ~Work() = default;
  /// Frees the last result; not timed.
  virtual void clear() = 0;
  /// Does all of it once; timed.
  virtual void run(StageClock& clock) = 0;
  /// What the last run made.
  virtual Message result() = 0;
};

struct Contender {
  std::string impl;
  int threads = 1;
  Message about = Message::object();            ///< fields for its results, such as a block size
  std::function<std::unique_ptr<Work>()> make;  ///< called in the child: threads start here
};

struct RaceConfig {
  int warm_ups = 2;
  int runs = 11;  ///< of each; 3 where every warm-up took over 2 s
  std::chrono::seconds patience{120};
  bool wants_results = true;
  bool quiet = false;  ///< what contenders print is dropped
};

/// What one contender did. Times are per run, without the warm-up.
struct Outcome {
  std::vector<double> ms, cpu_ms;  ///< cpu_ms: of all its threads
  std::vector<std::pair<std::string, std::vector<double>>> stage_ms;  ///< in order
  double peak_mb = 0;   ///< most memory it had, less what it had before it began; no program code
  std::string aborted;  ///< why it did not come to the end; empty: it did
  Message result;       ///< null where it was aborted, or not wanted

  bool usable() const { return !ms.empty(); }
};

double median(std::vector<double> values);
/// Nearest rank.
double percentile95(std::vector<double> values);

/// Runs contenders in turns, each in a process of its own that is forked before the first run, so
/// that all meet the same moods of the machine. One that dies is out; the others go on. `told`
/// hears how many runs are done, of how many.
std::vector<Outcome> race(const std::vector<Contender>& contenders, const RaceConfig& config,
                          const std::function<void(std::size_t, std::size_t)>& told = {});

/// The fields of a result that every stage has: impl, threads, case, ms, p95_ms, cpu_ms, runs,
/// stages, peak_mb, what the contender says about itself, and `aborted` where it was.
Message result_row(const Contender& contender, const std::string& case_name,
                   const Outcome& outcome);

}  // namespace mr::bench
