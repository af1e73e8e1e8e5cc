#include <mutex>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/node/coalesce_packets.h"
#include "mr/node/live_node.h"

namespace mr::node {

/// What arrived from one input and waits for the receiving thread.
struct LiveMerger::Inbox {
  net::Outbox packets{coalesce_packets};
  std::mutex mutex;
  std::vector<Answer> answers;
};

LiveMerger::LiveMerger(const LiveContext& context, const MergerConfig& merger,
                       std::vector<EncodedChunk> background)
    : context_(context),
      node_(*context.scene, merger, merger.id == context.scene->mergers.back().id,
            NodeClock::live(), StillWork::beside),
      credit_(context.frames_ahead),
      presence_(merger.inputs.size()),
      clocks_(merger.inputs.size()) {
  const auto tell = [this](const std::string& place, const Error& error) {
    context_.warn(node_.id(), place + ": " + error.message);
  };
  // Where nodes are programs of their own, some may never have been started.
  constexpr Duration kStart = std::chrono::seconds(5);
  if (context.frames_ahead > 1) presence_.begin(wall_time() + kStart);
  drops_.set_listener(tell);
  node_.inputs().set_drop_listener(tell);
  node_.set_background(std::move(background));
  service_ = context_.transport->serve(
      node_.id(), [this](std::span<const std::byte> question) { return answer(question); });
  for (const std::string& input : merger.inputs) {
    auto inbox = inboxes_.emplace_back(std::make_shared<Inbox>());
    subscriptions_.push_back(
        context_.transport->subscribe(input, [this, inbox](net::Message packet) {
          inbox->packets.push(std::move(packet));
          signal_->notify();
        }));
  }
  receives_ = std::jthread([this](const std::stop_token& stop) { receive(stop); });
  merges_ = std::jthread([this](const std::stop_token& stop) { merge(stop); });
}

void LiveMerger::receive(const std::stop_token& stop) {
  constexpr Duration kLookAgain = std::chrono::milliseconds(20);  // late answers are asked for anew
  Arena arena(context_.threads);
  while (!stop.stop_requested()) {
    const TimePoint now = wall_time();
    arena.run([&] { receive_what_waits(now); });
    if (key_frames_wanted_.exchange(false)) node_.inputs().ask_key_frames();
    node_.inputs().ask_key_frames(node_.take_key_frame_wishes());
    for (const auto& [input, sequence] : node_.take_shown())
      ask(input, {.key_frames = {}, .chunks = {}, .taken = {}, .shown = sequence});
    for (const auto& [input, request] : node_.inputs().requests(now)) ask(input, request);
    watch_inputs(now);
    const bool ready = node_.inputs().ready(now), begun = ready && credit_.try_begin();
    if (begun) hand_over(stop, now);

    // Who waits for credit is woken by it.
    const auto due = ready && !begun ? std::nullopt : node_.inputs().due();
    signal_->wait(
        stop, due ? std::clamp<Duration>(*due - now, Duration(100'000), kLookAgain) : kLookAgain);
  }
}

void LiveMerger::receive_what_waits(TimePoint now) {
  for (std::size_t i = 0; i < inboxes_.size(); ++i) {
    Inbox& inbox = *inboxes_[i];
    // A refusal is counted, and told, by the gatherer.
    if (const net::Message packet = inbox.packets.try_pop()) {
      static_cast<void>(node_.inputs().receive(i, *packet, now).ok());
      const std::lock_guard lock(watch_mutex_);
      if (const auto newest = node_.inputs().newest(i)) presence_.seen(i, *newest, now);
      if (clocks_[i].offset() != Duration{}) ++retimed_;
    }
    std::vector<Answer> answers;
    {
      const std::lock_guard lock(inbox.mutex);
      answers.swap(inbox.answers);
    }
    for (const Answer& answer : answers) take_answer(i, answer);
  }
}

/// Chunks, or what the input's clock says.
void LiveMerger::take_answer(std::size_t input, const Answer& answer) {
  const auto told = codec::decode_time(*answer.bytes);
  if (!told) return node_.inputs().take_answer(input, *answer.bytes, answer.came);
  const std::string& name = node_.config().inputs[input];
  if (!*told) return drops_.count(name + " → " + node_.id(), told->error());
  const std::lock_guard lock(watch_mutex_);
  ClockOffset& clock = clocks_[input];
  const Duration before = clock.offset();
  clock.add(answer.asked, **told, answer.came);
  if (clock.offset() == before) return;
  node_.inputs().set_clock_offset(input, clock.offset());
  context_.warn(node_.id(), clock.offset() == Duration{}
                                ? "the clock of '" + name + "' is right again"
                                : "the clock of '" + name + "' is " +
                                      said_of_clock(clock.offset()) +
                                      " this one; corrected. Synchronise the clocks (PTP, NTP)");
}

/// How long the last merge took, or this one has.
Duration LiveMerger::merging_for(TimePoint now) const {
  const Duration took(merge_took_ns_.load());
  const std::int64_t began = merge_began_ns_;
  return began == 0 ? took : std::max(took, now - TimePoint(Duration(began)));
}

/// Asks their clocks, and tells who has gone or come back.
void LiveMerger::watch_inputs(TimePoint now) {
  constexpr Duration kClocksEvery = std::chrono::seconds(1);
  if (is_time(clocks_asked_, kClocksEvery, now)) {
    clocks_asked_ = now;
    codec::Request request;
    request.time = true;
    for (std::size_t i = 0; i < inboxes_.size(); ++i) ask(i, request);
  }
  const std::lock_guard lock(watch_mutex_);
  presence_.set_pace(merging_for(now));
  for (const auto& [input, is_missing] : presence_.changes(now)) {
    const std::string name = "'" + node_.config().inputs[input] + "'";
    if (is_missing)
      context_.warn(node_.id(), name + " is missing: nothing new comes from it");
    else
      context_.tell(node_.id(), name + " is back");
  }
}

/// Gives the merging thread what has come together, and tells the inputs that it was taken.
void LiveMerger::hand_over(const std::stop_token& stop, TimePoint now) {
  auto gathered = node_.inputs().gather(now);
  if (!gathered) drops_.count(node_.id(), gathered.error());
  if (!gathered || !*gathered) return credit_.end(false);
  if (context_.frames_ahead > 1) acknowledge(**gathered);
  gathered_.put(stop, **std::move(gathered));
}

void LiveMerger::acknowledge(const Gathered& gathered) {
  for (const auto& [input, sequence] : gathered.taken)
    ask(input, {.key_frames = {}, .chunks = {}, .taken = sequence});
}

void LiveMerger::ask(std::size_t input, const codec::Request& request) {
  const std::string& node = node_.config().inputs[input];
  auto bytes = std::make_shared<const std::vector<std::byte>>(codec::encode_request(request));
  if (!request.wants_answer()) return context_.transport->request(node, std::move(bytes));
  context_.transport->request(node, std::move(bytes),
                              [inbox = std::weak_ptr(inboxes_[input]), signal = signal_,
                               asked = wall_time()](net::Message answer) {
                                constexpr std::size_t kMaxAnswers = 64;
                                const auto to = inbox.lock();
                                if (!to) return;
                                {
                                  const std::lock_guard lock(to->mutex);
                                  if (to->answers.size() < kMaxAnswers)
                                    to->answers.push_back({std::move(answer), asked, wall_time()});
                                }
                                signal->notify();
                              });
}

void LiveMerger::merge(const std::stop_token& stop) {
  Arena arena(context_.threads);
  while (const auto gathered = gathered_.take(stop)) {
    Result<std::vector<std::byte>> bytes = std::vector<std::byte>{};
    // On one machine the inputs' next frames would slow the first half down.
    bool told = context_.frames_ahead > 1;
    const auto tell = [&] {
      if (!std::exchange(told, true)) acknowledge(*gathered);
    };
    const TimePoint began = wall_time();
    merge_began_ns_ = began.time_since_epoch().count();
    arena.run([&] { bytes = node_.merge(*gathered, tell); });
    merge_began_ns_ = 0;
    merge_took_ns_ = (wall_time() - began).count();
    tell();
    if (const auto notice = node_.calibration().take_notice()) context_.warn(node_.id(), *notice);
    credit_.end(bytes.ok());
    if (bytes) {
      ++frames_;
      bytes_ += bytes->size();
      context_.transport->publish(
          node_.id(), std::make_shared<const std::vector<std::byte>>(*std::move(bytes)));
    } else {
      drops_.count(node_.id(), bytes.error());
      // What was to be handed on is lost.
      key_frames_wanted_ = node_.id() != context_.scene->mergers.back().id;
    }
    signal_->notify();
  }
}

net::Message LiveMerger::answer(std::span<const std::byte> question) {
  net::Message answer = answer_request(question, node_, credit_, limits_, drops_);
  signal_->notify();
  return answer;
}

LiveStats LiveMerger::stats() const {
  LiveStats out{node_.id(), frames_, drops_.by_cause(), node_.trace().stages(), bytes_};
  if (const auto refused = limits_.refused(); refused > 0)
    out.drops["requests to " + node_.id() + ": too soon after others"] = refused;
  if (retimed_ > 0) out.drops[node_.id() + ": packets of a wrong clock, corrected"] = retimed_;
  {
    const std::lock_guard lock(watch_mutex_);
    const TimePoint now = wall_time();
    out.is_silent = presence_.missing(now).size() == inboxes_.size();
    for (std::size_t i = 0; i < inboxes_.size(); ++i) {
      const std::string& name = node_.config().inputs[i];
      out.inputs[name] = !presence_.is_missing(i, now);
      out.clock_offsets_s[name] = std::chrono::duration<double>(clocks_[i].offset()).count();
    }
  }
  for (const auto& [cause, n] : node_.inputs().drops().by_cause()) out.drops[cause] += n;
  for (const auto& [stage, ms] : node_.inputs().trace().stages()) out.stages_ms[stage] = ms;
  for (std::size_t i = 0; i < inboxes_.size(); ++i) {
    const auto counts = inboxes_[i]->packets.counts();
    const std::string link = node_.config().inputs[i] + " → " + node_.id();
    if (counts.folded > 0) out.drops[link + ": folded, " + node_.id() + " is slow"] = counts.folded;
    if (counts.lost > 0) out.drops[link + ": lost, " + node_.id() + " is slow"] = counts.lost;
  }
  return out;
}

}  // namespace mr::node
