#include "mr/node/merge_task.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mr::node {

struct MergeTask::Tick final : Work {
  explicit Tick(CaptureSet of) : captures(std::move(of)) {}
  CaptureSet captures;
};

MergeTask::MergeTask(const Scene& scene, const MergerConfig& merger, NodeLog log, Options options)
    : is_root_(merger.id == scene.mergers.back().id),
      node_(scene, merger, is_root_, options.clock, options.still_work),
      log_(std::move(log)),
      presence_(merger.inputs.size()),
      clocks_(merger.inputs.size()),
      measures_links_(options.measures_links),
      coarsest_m_(rate::coarsest_error_m(scene.voxel_m)),
      now_(options.clock.now) {
  drops_.set_listener(log_.dropped);
  node_.inputs().set_drop_listener(log_.dropped);
  if (is_root_ && options.rate_model) {
    node_.control_rate(options.rate_model);
    if (!rung_names(scene).empty())
      rungs_ = std::make_unique<Rungs>(
          scene, merger,
          Rungs::Options{std::move(options.clock), options.still_work,
                         std::move(options.rate_model), options.background});
  }
  node_.set_background(std::move(options.background));
  for (const std::string& input : merger.inputs) {
    const auto link = std::ranges::find_if(scene.links, [&](const LinkConfig& l) {
      return l.from == input && l.to == merger.id && l.limit_mbps > 0;
    });
    links_.emplace_back(link == scene.links.end() ? std::nullopt : std::optional(link->limit_mbps));
  }
  if (options.inputs_since) presence_.begin(*options.inputs_since);
}

std::vector<Ask> MergeTask::step(const Arrivals& arrivals, TimePoint now) {
  for (const auto& [input, bytes] : arrivals.packets) {
    // The synchronizer counts and logs refused packets.
    if (node_.inputs().receive(input, *bytes, now)) watch_link(input, bytes->size(), now);
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
  if (!plan_) return;
  ScenePlan plan = limited(*plan_);
  if (plan == passed_ && !is_due(plan_passed_, kPlanEvery, now)) return;
  plan_passed_ = now, passed_ = plan;
  codec::Control control;
  control.plan = std::move(plan);
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
  links_[answer.input].forget_delays();
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
  plan_ = plan;
}

/// Measures what comes over the link from an input, and tells people when it is too narrow.
void MergeTask::watch_link(std::size_t input, std::size_t bytes, TimePoint now) {
  rate::LinkBudget& link = links_[input];
  const bool was_narrow = link.coarser() > 0;
  link.arrived(static_cast<double>(bytes),
               measures_links_ ? node_.inputs().sent_at(input) : std::nullopt, now);
  const bool is_narrow = link.coarser() > 0;
  if (is_narrow == was_narrow || !passed_) return;
  const std::string name = "the link from '" + node_.config().inputs[input] + "'";
  log_.info(is_narrow
                ? fmt::format("{} carries {:.1f} Mbit/s: what comes over it is coded more coarsely",
                              name, link.limit_mbps().value_or(0))
                : name + " is wide enough again");
}

/// A plan, coarser for the sensors behind narrow links.
ScenePlan MergeTask::limited(ScenePlan plan) const {
  constexpr double kQpPerDoubledError = 12;
  constexpr int kCoarsestQp = 51;
  for (std::size_t i = 0; i < links_.size(); ++i)
    if (const int coarser = links_[i].coarser(); coarser > 0)
      for (const SensorId sensor : node_.inputs().sensors_of(i)) {
        CodingPlan of_sensor = plan.of(sensor);
        of_sensor.texture_qp = std::min(of_sensor.texture_qp + coarser, kCoarsestQp);
        double& error_m = of_sensor.decimation.error_m;
        error_m = std::max(
            error_m, std::min(error_m * std::exp2(coarser / kQpPerDoubledError), coarsest_m_));
        plan.by_sensor[sensor] = of_sensor;
      }
  return plan;
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
  const TimePoint begun = now_ ? now_() : TimePoint{};
  auto bytes = node_.merge(static_cast<Tick&>(work).captures, first_part_done);
  if (now_) took_ = now_() - begun;
  if (const auto notice = node_.calibration().take_notice()) log_.warn(*notice);
  if (const auto plan = node_.take_plan()) pass_on(*plan);
  if (bytes) return *std::move(bytes);
  drops_.count(id(), bytes.error(), bytes.error().cause != Error::Cause::over_budget);
  key_frames_wanted_ = !is_root_;
  return std::nullopt;
}

Task::Bytes MergeTask::answer_rung(std::size_t rung, const codec::Control& request, TimePoint now) {
  return rungs_->answer(rung, request, now);
}

std::vector<std::pair<std::size_t, Task::Bytes>> MergeTask::finish_rungs(Work& work,
                                                                         TimePoint now) {
  if (!rungs_) return {};
  std::vector<Rungs::Missing> missing;
  auto packets = rungs_->merge(static_cast<const Tick&>(work).captures, node_, took_, now, missing);
  for (const auto& [rung, why] : missing)
    drops_.count(rungs_->names()[rung], why, why.cause != Error::Cause::over_budget);
  return packets;
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
