#include "mr/runtime/port.h"

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

namespace mr::runtime {
namespace {

constexpr std::size_t kMostAnswers = 64;  // waiting, of one input

/// Lets what happens again and again through once a second. Any thread.
class RateLimit {
 public:
  bool is_due(TimePoint now) {
    const std::lock_guard lock(mutex_);
    if (!mr::is_due(last_, std::chrono::seconds(1), now)) return false;
    last_ = now;
    return true;
  }

 private:
  std::mutex mutex_;
  std::optional<TimePoint> last_;
};

}  // namespace

/// The queues of one input.
struct Port::Inbox {
  explicit Inbox(const net::Coalesce& fold) : packets(fold) {}
  net::Outbox packets;
  std::mutex mutex;
  std::vector<node::Arrivals::Answer> answers;
};

Port::Port(net::Transport& transport, Config config)
    : transport_(transport), config_(std::move(config)) {
  for (const std::string& input : config_.inputs) {
    auto inbox = inboxes_.emplace_back(std::make_shared<Inbox>(config_.fold));
    subscriptions_.push_back(
        transport_.subscribe(input, [inbox, wake = config_.wake](net::Message packet) {
          inbox->packets.push(std::move(packet));
          if (wake) wake();
        }));
  }
}

void Port::serve(const std::string& name, Answering answering, DropCounter& drops) {
  subscriptions_.push_back(transport_.serve(
      name,
      [answering = std::move(answering), &drops, clock = config_.clock, id = name,
       limit = std::make_shared<RateLimit>()](std::span<const std::byte> question) -> net::Message {
        auto request = codec::decode_control(question);
        if (!request) {
          drops.count("requests to " + id, request.error(), limit->is_due(clock()));
          return request.error().cause == Error::Cause::unsupported
                     ? net::as_message(codec::encode_refusal(request.error().message))
                     : nullptr;
        }
        const TimePoint now = clock();
        const bool is_time_asked = std::exchange(request->time, false);
        if (is_time_asked) request->chunks.clear();  // the answer holds only the time
        auto bytes = answering(*request, now);
        if (is_time_asked) bytes = codec::encode_time(now);
        return bytes.empty() ? nullptr : net::as_message(std::move(bytes));
      }));
}

node::Arrivals Port::take() {
  node::Arrivals out;
  for (std::size_t i = 0; i < inboxes_.size(); ++i) {
    Inbox& inbox = *inboxes_[i];
    while (net::Message packet = inbox.packets.try_pop())
      out.packets.push_back({i, std::move(packet)});
    const std::lock_guard lock(inbox.mutex);
    std::ranges::move(inbox.answers, std::back_inserter(out.answers));
    inbox.answers.clear();
  }
  return out;
}

void Port::send(const std::vector<node::Ask>& asks) {
  for (const auto& [input, request] : asks) {
    const std::string& to = config_.inputs[input];
    net::Message question = net::as_message(codec::encode_control(request));
    if (!request.wants_answer()) {
      transport_.request(to, std::move(question));
      continue;
    }
    transport_.request(
        to, std::move(question),
        [inbox = std::weak_ptr(inboxes_[input]), input = input, asked = config_.clock(),
         clock = config_.clock, wake = config_.wake](net::Message answer) {
          const auto into = inbox.lock();
          if (!into) return;
          {
            const std::lock_guard lock(into->mutex);
            if (into->answers.size() < kMostAnswers)
              into->answers.push_back({input, std::move(answer), asked, clock()});
          }
          if (wake) wake();
        });
  }
}

std::map<std::string, std::uint64_t> Port::drops() const {
  std::map<std::string, std::uint64_t> out;
  for (std::size_t i = 0; i < inboxes_.size(); ++i) {
    const auto counts = inboxes_[i]->packets.counts();
    const std::string link = config_.inputs[i] + " → " + config_.id;
    if (counts.folded > 0) out[link + ": folded, " + config_.id + " is slow"] = counts.folded;
    if (counts.lost > 0) out[link + ": lost, " + config_.id + " is slow"] = counts.lost;
  }
  return out;
}

}  // namespace mr::runtime
