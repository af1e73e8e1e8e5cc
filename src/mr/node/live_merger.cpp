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
  std::vector<net::Message> answers;
};

LiveMerger::LiveMerger(const LiveContext& context, const MergerConfig& merger,
                       std::vector<EncodedChunk> background)
    : context_(context),
      node_(*context.scene, merger, merger.id == context.scene->mergers.back().id,
            NodeClock::live(), StillWork::beside),
      credit_(context.frames_ahead) {
  const auto tell = [this](const std::string& place, const Error& error) {
    context_.log(place + ": " + error.message);
  };
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
    if (const net::Message packet = inbox.packets.try_pop())
      static_cast<void>(node_.inputs().receive(i, *packet, now).ok());
    std::vector<net::Message> answers;
    {
      const std::lock_guard lock(inbox.mutex);
      answers.swap(inbox.answers);
    }
    for (const net::Message& answer : answers) node_.inputs().take_answer(i, *answer, now);
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
  if (request.chunks.empty()) return context_.transport->request(node, std::move(bytes));
  context_.transport->request(
      node, std::move(bytes),
      [inbox = std::weak_ptr(inboxes_[input]), signal = signal_](net::Message answer) {
        constexpr std::size_t kMaxAnswers = 64;
        const auto to = inbox.lock();
        if (!to) return;
        {
          const std::lock_guard lock(to->mutex);
          if (to->answers.size() < kMaxAnswers) to->answers.push_back(std::move(answer));
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
    arena.run([&] { bytes = node_.merge(*gathered, tell); });
    tell();
    if (const auto notice = node_.calibration().take_notice())
      context_.log(node_.id() + ": " + *notice);
    credit_.end(bytes.ok());
    if (bytes) {
      ++frames_;
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
  net::Message answer = answer_request(question, node_, credit_, drops_);
  signal_->notify();
  return answer;
}

LiveStats LiveMerger::stats() const {
  LiveStats out{node_.id(), frames_, drops_.by_cause(), node_.trace().stages()};
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
