#include "race.h"

#include "mr/core/trace.h"
#include "report.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <thread>

namespace mr::bench {
namespace {

constexpr double kSlowRun_ms = 2000;
constexpr int kRunsOfSlow = 3;
/// Idle threads of the one before spin for a while before they sleep.
constexpr auto kPause = std::chrono::milliseconds(10);
constexpr double kShort_ms = 100;  // shorter runs are made twice, the first one untimed

/// A value of /proc/self/status, in kB; 0: missing.
double memory_kb(const std::string& name) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == name + ":") {
      double kb = 0;
      status >> kb;
      return kb;
    }
  return 0;
}

Message run_once(Work& work) {
  work.clear();
  const double cpu_before = process_cpu_ms();
  const auto start = std::chrono::steady_clock::now();
  StageClock clock;
  work.run(clock);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
  return {{"ms", took.count()},
          {"cpu_ms", process_cpu_ms() - cpu_before},
          {"stages", clock.stage_ms()}};
}

/// The child's side: "run", "memory", "result".
Answerer contender_at_work(const Contender& contender) {
  ::malloc_trim(0);  // else what the parent freed would be memory that costs nothing
  std::ofstream("/proc/self/clear_refs") << "5";  // the peak counts from here; may be refused
  // A forked child meets its program's own pages anew: those of files are not its memory.
  const auto files_kb = [] { return memory_kb("RssFile"); };
  const double before_kb = memory_kb("VmRSS") - files_kb();
  const std::shared_ptr<Work> work = contender.make();
  const auto last_ms = std::make_shared<double>(0);
  return [work, before_kb, files_kb, last_ms](const Message& question) -> Message {
    if (question == "run") {
      // While the others ran, its caches went cold and its threads to sleep: that is not the code.
      if (*last_ms > 0 && *last_ms < kShort_ms) run_once(*work);
      const Message told = run_once(*work);
      *last_ms = told["ms"];
      return told;
    }
    if (question == "memory") return (memory_kb("VmHWM") - files_kb() - before_kb) * 1024 / 1e6;
    return work->result();
  };
}

/// Adds one run's stages to those of the runs before.
void add_stages(const Message& stages, Outcome& outcome) {
  for (const auto& [name, ms] : stages.items()) {
    auto at = std::find_if(outcome.stage_ms.begin(), outcome.stage_ms.end(),
                           [&](const auto& stage) { return stage.first == name; });
    if (at == outcome.stage_ms.end())
      at = outcome.stage_ms.insert(at, {name, std::vector<double>{}});
    at->second.push_back(ms);
  }
}

/// A contender's process and what it did so far.
struct Runner {
  std::optional<Child> child;
  Outcome outcome;
  int wanted = 0;
  double quickest_ms = std::numeric_limits<double>::infinity();  ///< of the warm-ups

  bool alive() const { return child.has_value(); }

  /// Nothing when it died of it.
  std::optional<Message> ask(const Message& question, const RaceConfig& config) {
    auto answer = child->ask(question, config.patience);
    if (answer) return *std::move(answer);
    outcome.aborted = answer.error().message;
    child.reset();
    return std::nullopt;
  }

  std::optional<Message> run(const RaceConfig& config) {
    std::this_thread::sleep_for(kPause);
    return ask("run", config);
  }

  void warm_up(const RaceConfig& config) {
    if (const auto told = run(config)) quickest_ms = std::min<double>(quickest_ms, told->at("ms"));
    wanted = quickest_ms > kSlowRun_ms ? std::min(config.runs, kRunsOfSlow) : config.runs;
  }

  void measure(const RaceConfig& config) {
    if (static_cast<int>(outcome.ms.size()) >= wanted) return;
    const auto told = run(config);
    if (!told) return;
    outcome.ms.push_back(told->at("ms"));
    outcome.cpu_ms.push_back(told->at("cpu_ms"));
    add_stages(told->at("stages"), outcome);
  }

  void finish(const RaceConfig& config) {
    if (!alive()) return;
    if (const auto memory = ask("memory", config)) outcome.peak_mb = *memory;
    if (!alive() || !config.wants_results) return;
    if (auto result = ask("result", config)) outcome.result = *std::move(result);
  }
};

std::vector<Runner> start_all(const std::vector<Contender>& contenders, const RaceConfig& config) {
  std::vector<Runner> runners(contenders.size());
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    runners[i].wanted = config.runs;
    auto child = Child::start([&, i] { return contender_at_work(contenders[i]); }, config.quiet);
    if (child)
      runners[i].child.emplace(*std::move(child));
    else
      runners[i].outcome.aborted = child.error().message;
  }
  return runners;
}

}  // namespace

void StageClock::lap(const std::string& stage) {
  const std::chrono::duration<double, std::milli> took = Clock::now() - last_;
  add(stage, took.count());
  skip();
}

void StageClock::skip() { last_ = Clock::now(); }

void StageClock::add(const std::string& stage, double ms) {
  stage_ms_[stage] = stage_ms_.value(stage, 0.0) + ms;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

double percentile95(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[(values.size() * 95 + 99) / 100 - 1];
}

std::vector<Outcome> race(const std::vector<Contender>& contenders, const RaceConfig& config,
                          const std::function<void(std::size_t, std::size_t)>& told) {
  std::vector<Runner> runners = start_all(contenders, config);
  const int rounds = config.warm_ups + config.runs;
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < runners.size(); ++i) {
      if (told) told(round * runners.size() + i, rounds * runners.size());
      if (!runners[i].alive()) continue;
      round < config.warm_ups ? runners[i].warm_up(config) : runners[i].measure(config);
    }
  std::vector<Outcome> out;
  for (Runner& runner : runners) {
    runner.finish(config);
    out.push_back(std::move(runner.outcome));
  }
  return out;
}

Message result_row(const Contender& contender, const std::string& case_name,
                   const Outcome& outcome) {
  Message row{{"impl", contender.impl}, {"threads", contender.threads},
              {"case", case_name},      {"ms", nullptr},
              {"p95_ms", nullptr},      {"runs", outcome.ms.size()}};
  if (outcome.usable()) {
    row["ms"] = rounded(median(outcome.ms), 3);
    row["p95_ms"] = rounded(percentile95(outcome.ms), 3);
    row["cpu_ms"] = rounded(median(outcome.cpu_ms), 3);
    row["stages"] = Message::object();
    for (const auto& [stage, ms] : outcome.stage_ms) row["stages"][stage] = rounded(median(ms), 3);
    if (outcome.peak_mb > 0) row["peak_mb"] = rounded(outcome.peak_mb, 3);
  }
  row.update(contender.about);
  if (!outcome.aborted.empty()) row["aborted"] = true, row["why"] = outcome.aborted;
  return row;
}

}  // namespace mr::bench
