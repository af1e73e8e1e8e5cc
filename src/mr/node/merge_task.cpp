#include "mr/node/merge_task.h"

#include <utility>

namespace mr::node {

struct MergeTask::Tick final : Work {
  explicit Tick(CaptureSet of) : captures(std::move(of)) {}
  CaptureSet captures;
};

MergeTask::MergeTask(const Scene& scene, const MergerConfig& merger, NodeLog log, Options options)
    : is_root_(merger.id == scene.mergers.back().id),
      node_(scene, merger, is_root_, std::move(options.clock), options.still_work),
      log_(std::move(log)),
      presence_(merger.inputs.size()),
      clocks_(merger.inputs.size()) {
  drops_.set_listener(log_.dropped);
  node_.inputs().set_drop_listener(log_.dropped);
  node_.set_background(std::move(options.background));
  if (is_root_ && options.rate_model) node_.control_rate(std::move(options.rate_model));
  if (options.inputs_since) presence_.begin(*options.inputs_since);
}

std::vector<Ask> MergeTask::step(const Arrivals& arrivals, TimePoint now) {
  for (const auto& [input, bytes] : arrivals.packets) {
    // The synchronizer counts and logs refused packets.
    static_cast<void>(node_.inputs().receive(input, *bytes, now).ok());
    const std::lock_guard lock(watch_mutex_);
    if (const auto newest = node_.inputs().newest(input)) presence_.seen(input, *newest, now);
    if (clocks_[input].offset() != Duration{}) ++retimed_;
  }
  for (const Arrivals::Answer& answer : arrivals.answers) take_answer(answer);

  if (key_frames_wanted_.exchange(false)) node_.inputs().ask_key_frames();
  node_.inputs().ask_key_frames(node_.take_wanted_key_frames());
  std::vector<Ask> asks;
  for (const auto& [input, sequence] : node_.take_shown())
    asks.push_back({input, {.key_frames = {}, .chunks = {}, .taken = {}, .shown = sequence}});
  for (auto& [input, request] : node_.inputs().requests(now))
    asks.push_back({input, std::move(request)});
  if (constexpr Duration kClocksEvery = std::chrono::seconds(1);
      is_due(clocks_asked_, kClocksEvery, now)) {
    clocks_asked_ = now;
    codec::Control request;
    request.time = true;
    for (std::size_t i = 0; i < clocks_.size(); ++i) asks.push_back({i, request});
  }
  pass_plan(now, asks);
  watch_inputs(arrivals.busy, now);
  return asks;
}

/// Sends the plan to the inputs at once and then periodically: messages may be lost, and inputs may
/// restart.
void MergeTask::pass_plan(TimePoint now, std::vector<Ask>& asks) {
  constexpr Duration kPlanEvery = std::chrono::seconds(1);
  const std::lock_guard lock(plan_mutex_);
  if (!plan_ || !is_due(plan_passed_, kPlanEvery, now)) return;
  plan_passed_ = now;
  codec::Control control;
  control.plan = plan_;
  for (std::size_t i = 0; i < clocks_.size(); ++i) asks.push_back({i, control});
}

/// Handles an answer of an input: chunks, or the input's clock.
void MergeTask::take_answer(const Arrivals::Answer& answer) {
  const auto reported = codec::decode_time(*answer.bytes);
  if (!reported) return node_.inputs().take_answer(answer.input, *answer.bytes, answer.came);
  const std::string& name = node_.config().inputs[answer.input];
  if (!*reported) return drops_.count(name + " → " + id(), reported->error());
  const std::lock_guard lock(watch_mutex_);
  ClockOffset& clock = clocks_[answer.input];
  const Duration before = clock.offset();
  clock.add(answer.asked, **reported, answer.came);
  if (clock.offset() == before) return;
  node_.inputs().set_clock_offset(answer.input, clock.offset());
  log_.warn(clock.offset() == Duration{}
                ? "the clock of '" + name + "' is right again"
                : "the clock of '" + name + "' is " + clock_offset_text(clock.offset()) +
                      " this one; corrected. Synchronise the clocks (PTP, NTP)");
}

/// Logs inputs that went missing or came back.
void MergeTask::watch_inputs(Duration busy, TimePoint now) {
  const std::lock_guard lock(watch_mutex_);
  presence_.set_pace(busy);
  for (const auto& [input, is_missing] : presence_.changes(now)) {
    const std::string name = "'" + node_.config().inputs[input] + "'";
    if (is_missing)
      log_.warn(name + " is missing: nothing new comes from it");
    else
      log_.info(name + " is back");
  }
}

Task::Bytes MergeTask::answer(const codec::Control& control, TimePoint) {
  if (control.plan) pass_on(*control.plan);
  return node_.answer(control);
}

/// With the next step.
void MergeTask::pass_on(const ScenePlan& plan) {
  const std::lock_guard lock(plan_mutex_);
  if (plan_ != plan) plan_ = plan, plan_passed_.reset();
}

std::unique_ptr<Task::Work> MergeTask::begin(TimePoint now) {
  auto captures = node_.inputs().next_set(now);
  if (!captures) drops_.count(id(), captures.error());
  if (!captures || !*captures) return nullptr;
  return std::make_unique<Tick>(**std::move(captures));
}

std::vector<Ask> MergeTask::taken(const Work& work) const {
  std::vector<Ask> asks;
  for (const auto& [input, sequence] : static_cast<const Tick&>(work).captures.taken)
    asks.push_back({input, {.key_frames = {}, .chunks = {}, .taken = sequence}});
  return asks;
}

std::optional<Task::Bytes> MergeTask::finish(Work& work,
                                             const std::function<void()>& first_part_done) {
  auto bytes = node_.merge(static_cast<Tick&>(work).captures, first_part_done);
  if (const auto notice = node_.calibration().take_notice()) log_.warn(*notice);
  if (const auto plan = node_.take_plan()) pass_on(*plan);
  if (bytes) return *std::move(bytes);
  drops_.count(id(), bytes.error(), bytes.error().cause != Error::Cause::over_budget);
  key_frames_wanted_ = !is_root_;
  return std::nullopt;
}

NodeStats MergeTask::stats(TimePoint now) const {
  NodeStats out{.id = id(), .drops = drops_.by_cause(), .stages_ms = node_.trace().stages()};
  if (retimed_ > 0) out.drops[id() + ": packets of a wrong clock, corrected"] = retimed_;
  for (const auto& [cause, n] : node_.inputs().drops().by_cause()) out.drops[cause] += n;
  for (const auto& [stage, ms] : node_.inputs().trace().stages()) out.stages_ms[stage] = ms;
  const std::lock_guard lock(watch_mutex_);
  out.is_silent = presence_.missing(now).size() == clocks_.size();
  for (std::size_t i = 0; i < clocks_.size(); ++i) {
    const std::string& name = node_.config().inputs[i];
    out.inputs[name] = !presence_.is_missing(i, now);
    out.clock_offsets_s[name] = std::chrono::duration<double>(clocks_[i].offset()).count();
  }
  return out;
}

}  // namespace mr::node
