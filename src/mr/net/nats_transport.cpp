#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <random>
#include <set>
#include <thread>
#include <utility>

#include "mr/net/little_endian.h"
#include "mr/net/nats_link.h"
#include "mr/net/pending_requests.h"
#include "mr/net/rate_limited_log.h"
#include "mr/net/registry.h"
#include "mr/net/transport.h"

namespace mr::net {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kNatsTick{500};
constexpr std::chrono::seconds kHeartbeatPeriod{1};
constexpr std::size_t kHeartbeatBytes = 8;
constexpr int kNatsAnswers = 8;  // unsent, per requester: enough for a program of a few mergers

/// A name as one token of a subject: everything but letters, digits, '-' and '_' as %XX.
std::string token(const std::string& name) {
  constexpr char kHex[] = "0123456789ABCDEF";
  std::string out;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    if (plain || c == '-' || c == '_')
      out += c;
    else
      out += {'%', kHex[byte >> 4], kHex[byte & 15]};
  }
  return out;
}

std::uint64_t random_number() {
  std::random_device random;
  return (std::uint64_t{random()} << 32) | random();
}

/// Encodes a number as 8 bytes.
Message number_message(std::uint64_t number) {
  auto bytes = std::make_shared<std::vector<std::byte>>(sizeof number);
  put(bytes->data(), number);
  return bytes;
}

/// The number after the last dot of a subject; 0: none.
std::uint64_t last_number(const std::string& subject) {
  std::uint64_t number = 0;
  for (const char c : subject.substr(subject.rfind('.') + 1))
    number = c >= '0' && c <= '9' ? number * 10 + static_cast<std::uint64_t>(c - '0') : 0;
  return number;
}

class NatsSubscription final : public Subscription {
 public:
  NatsSubscription(const std::shared_ptr<NatsLink>& link, std::shared_ptr<NatsReceiver> receiver)
      : link_(link), receiver_(std::move(receiver)) {}
  NatsSubscription(const NatsSubscription&) = delete;
  NatsSubscription& operator=(const NatsSubscription&) = delete;
  ~NatsSubscription() override {
    if (const auto link = link_.lock()) link->forget(receiver_);
  }

 private:
  std::weak_ptr<NatsLink> link_;  ///< the transport may be gone
  std::shared_ptr<NatsReceiver> receiver_;
};

/// A service: the subscriptions to requests and to other programs' heartbeats.
class NatsService final : public Subscription {
 public:
  NatsService(std::unique_ptr<Subscription> ask, std::unique_ptr<Subscription> heartbeats,
              std::shared_ptr<const std::string> node)
      : ask_(std::move(ask)), heartbeats_(std::move(heartbeats)), node_(std::move(node)) {}

 private:
  std::unique_ptr<Subscription> ask_, heartbeats_;
  std::shared_ptr<const std::string> node_;  ///< heartbeats are sent while it lives
};

/// One thread sends everything, so that callers do not block on a slow server.
class NatsTransport final : public Transport {
 public:
  NatsTransport(std::shared_ptr<NatsLink> link, std::shared_ptr<Drops> drops,
                const std::string& scene, const TransportLimits& limits, Coalesce coalesce)
      : link_(std::move(link)),
        drops_(std::move(drops)),
        prefix_("mr." + token(scene) + "."),
        inbox_("_INBOX." + prefix_ + std::to_string(random_number())),
        id_(random_number()),
        limits_(limits),
        coalesce_(std::move(coalesce)),
        log_lines_(limits.log) {
    sender_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  ~NatsTransport() override {
    sender_.request_stop();
    sender_.join();
    link_->close();
  }
  NatsTransport(const NatsTransport&) = delete;
  NatsTransport& operator=(const NatsTransport&) = delete;

  void publish(const std::string& node, Message packet) override {
    if (!packet) return;
    if (packet->size() > limits_.message_bytes)
      return drops_->count("node " + node, "packet too large");
    outbox_of(node).push(std::move(packet));
    {
      const std::lock_guard lock(mutex_);
      work_ = true;
    }
    wake_.notify_one();
  }

  std::unique_ptr<Subscription> subscribe(const std::string& node,
                                          std::function<void(Message)> on_packet) override {
    return subscription(packet_subject(node), limits_.message_bytes,
                        [on_packet = std::move(on_packet)](const NatsArrival& packet) {
                          on_packet(packet.message);
                        });
  }

  void request(const std::string& node, Message message,
               std::function<void(Message)> on_answer) override {
    if (!message) return;
    if (message->size() > kMaxRequestBytes)
      return drops_->count("node " + node, "request too large");
    if (!on_answer) return send_later({ask_subject(node), "", std::move(message)});
    open_inbox();
    const std::uint64_t id = requests_.add(Clock::now(), nullptr, std::move(on_answer));
    if (id == 0) return drops_->count("node " + node, "too many requests at once");
    send_later({ask_subject(node), inbox_ + "." + std::to_string(id), std::move(message)});
  }

  std::unique_ptr<Subscription> serve(
      const std::string& node, std::function<Message(std::span<const std::byte>)> answer) override {
    auto ask = subscription(
        ask_subject(node), kMaxRequestBytes,
        [this, answer = std::move(answer)](const NatsArrival& request) { asked(request, answer); });
    auto heartbeats =
        subscription(heartbeat_subject(node), kHeartbeatBytes,
                     [this, node](const NatsArrival& other) { on_heartbeat(node, other); });
    auto name = std::make_shared<const std::string>(node);
    start_heartbeats(name);
    return std::make_unique<NatsService>(std::move(ask), std::move(heartbeats), std::move(name));
  }

  std::map<std::string, std::uint64_t> drops() const override {
    const std::lock_guard lock(mutex_);
    for (const auto& [node, sending] : packets_) {
      const Outbox::Counts now = sending.outbox->counts();
      drops_->count("sending " + node, "packets folded", now.folded - sending.reported.folded);
      drops_->count("sending " + node, "packets lost", now.lost - sending.reported.lost);
      sending.reported = now;
    }
    return drops_->all();
  }

 private:
  struct OutgoingMessage {
    std::string subject, reply;
    Message message;
    std::string inbox = {};  ///< of an answer: the requester's
  };
  struct Sending {
    std::unique_ptr<Outbox> outbox;
    mutable Outbox::Counts reported;
  };

  std::string packet_subject(const std::string& node) const {
    return prefix_ + token(node) + ".packet";
  }
  std::string ask_subject(const std::string& node) const { return prefix_ + token(node) + ".ask"; }
  std::string heartbeat_subject(const std::string& node) const {
    return prefix_ + token(node) + ".here";
  }

  std::unique_ptr<Subscription> subscription(const std::string& subject, std::size_t message_bytes,
                                             NatsLink::Handler handler) {
    return std::make_unique<NatsSubscription>(
        link_, link_->receive(subject, message_bytes, std::move(handler)));
  }

  /// Subscribes to the inbox at the first request, so that others do not need the permission.
  void open_inbox() {
    std::call_once(inbox_opened_, [this] {
      link_->receive(inbox_ + ".*", limits_.message_bytes,
                     [this](const NatsArrival& answer) { answered(answer); });
    });
  }

  /// Answers a request. A peer whose answers are still queued beyond a limit gets none.
  void asked(const NatsArrival& request,
             const std::function<Message(std::span<const std::byte>)>& answer) {
    const std::string inbox = request.reply.substr(0, request.reply.rfind('.'));
    if (!inbox.empty() && answers_to(inbox) >= kNatsAnswers)
      return drops_->count("subject " + request.subject, "asked again before the answers went");
    Message message = answer(*request.message);
    if (message && !inbox.empty()) send_later({request.reply, "", std::move(message), inbox});
  }

  int answers_to(const std::string& inbox) const {
    const std::lock_guard lock(mutex_);
    const auto at = answers_.find(inbox);
    return at == answers_.end() ? 0 : at->second;
  }

  void on_heartbeat(const std::string& node, const NatsArrival& other) {
    std::span<const std::byte> bytes = *other.message;
    if (bytes.size() != kHeartbeatBytes || take<std::uint64_t>(bytes) == id_) return;
    drops_->count("node " + node, kDuplicateNodeCause);
    log_lines_.log(duplicate_node_line(node), Clock::now());
  }

  /// Sends heartbeats for a node at once and each second while `node` lives.
  void start_heartbeats(const std::shared_ptr<const std::string>& node) {
    {
      const std::lock_guard lock(mutex_);
      serving_.push_back(node);
      heartbeat_due_ = work_ = true;
    }
    wake_.notify_one();
  }

  void send_heartbeats(Clock::time_point now) {
    std::set<std::string> nodes;
    {
      const std::lock_guard lock(mutex_);
      if (!std::exchange(heartbeat_due_, false) && now < next_heartbeat_) return;
      next_heartbeat_ = now + kHeartbeatPeriod;
      std::erase_if(serving_, [](const auto& node) { return node.expired(); });
      for (const auto& serving : serving_)
        if (const auto node = serving.lock()) nodes.insert(*node);
    }
    const Message id = number_message(id_);
    for (const std::string& node : nodes)
      static_cast<void>(link_->send(heartbeat_subject(node), "", id));  // no server: nothing to do
  }

  void answered(const NatsArrival& answer) {
    if (const auto on_answer = requests_.take(last_number(answer.subject)))
      on_answer(answer.message);
  }

  /// The outbox of a node's packets; created on first use, never removed.
  Outbox& outbox_of(const std::string& node) {
    const std::lock_guard lock(mutex_);
    auto& outbox = packets_[node].outbox;
    if (!outbox)
      outbox = std::make_unique<Outbox>(coalesce_,
                                        OutboxLimits{limits_.queue_messages, limits_.queue_bytes});
    return *outbox;
  }

  /// Queues a request or an answer.
  void send_later(OutgoingMessage letter) {
    {
      const std::lock_guard lock(mutex_);
      if (letter_bytes_ + letter.message->size() > limits_.queue_bytes)
        return drops_->count("NATS server", "too slow, questions or answers lost");
      letter_bytes_ += letter.message->size();
      if (!letter.inbox.empty()) ++answers_[letter.inbox];
      letters_.push_back(std::move(letter));
      work_ = true;
    }
    wake_.notify_one();
  }

  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) try {
        std::unique_lock lock(mutex_);
        wake_.wait_for(lock, stop, kNatsTick, [&] { return work_; });
        work_ = false;
        lock.unlock();
        do tick(Clock::now());
        while (!stop.stop_requested() && send_some());
      } catch (const std::exception& e) {
        if (limits_.log) limits_.log(std::string("NATS transport: ") + e.what());
      }
  }

  void tick(Clock::time_point now) {
    send_heartbeats(now);
    if (now < next_tick_) return;
    next_tick_ = now + kNatsTick;
    drops_->count("NATS", "requests without an answer", requests_.expire(now));
    link_->reconnect();
  }

  /// Sends all queued requests and answers, and one packet of each node; false: there was nothing.
  bool send_some() {
    std::deque<OutgoingMessage> letters;
    std::vector<std::pair<std::string, Outbox*>> outboxes;
    {
      const std::lock_guard lock(mutex_);
      letters.swap(letters_);
      letter_bytes_ = 0;
      for (const auto& [node, sending] : packets_)
        if (!sending.outbox->empty()) outboxes.emplace_back(node, sending.outbox.get());
    }
    for (const OutgoingMessage& letter : letters) {
      send(letter);
      if (!letter.inbox.empty()) answer_sent(letter.inbox);
    }
    for (const auto& [node, outbox] : outboxes)
      if (Message packet = outbox->try_pop()) send({packet_subject(node), "", std::move(packet)});
    return !letters.empty() || !outboxes.empty();
  }

  /// An answer was sent or lost.
  void answer_sent(const std::string& inbox) {
    const std::lock_guard lock(mutex_);
    const auto at = answers_.find(inbox);
    if (--at->second == 0) answers_.erase(at);
  }

  void send(const OutgoingMessage& letter) {
    const auto sent = link_->send(letter.subject, letter.reply, letter.message);
    if (!sent) drops_->count("NATS server", "messages not sent: " + sent.error().message);
  }

  const std::shared_ptr<NatsLink> link_;
  const std::shared_ptr<Drops> drops_;
  const std::string prefix_;
  const std::string inbox_;
  const std::uint64_t id_;  ///< of this program, in its heartbeats
  const TransportLimits limits_;
  const Coalesce coalesce_;
  RateLimitedLog log_lines_;
  PendingRequests requests_;
  std::once_flag inbox_opened_;
  Clock::time_point next_tick_;  ///< sender thread

  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  std::map<std::string, Sending> packets_;  ///< by node
  std::deque<OutgoingMessage> letters_;
  std::size_t letter_bytes_ = 0;
  std::map<std::string, int> answers_;  ///< number of queued and sending answers, by inbox
  std::vector<std::weak_ptr<const std::string>> serving_;  ///< names of nodes
  Clock::time_point next_heartbeat_;
  bool heartbeat_due_ = false;
  bool work_ = false;
  std::jthread sender_;
};

}  // namespace

Result<std::unique_ptr<Transport>> make_nats_transport(const NatsConfig& config,
                                                       const std::string& scene,
                                                       const TransportLimits& limits,
                                                       Coalesce coalesce) {
  try {
    auto drops = std::make_shared<Drops>();
    auto link = NatsLink::open(config, limits, drops);
    if (!link) return link.error();
    return std::unique_ptr<Transport>(
        std::make_unique<NatsTransport>(*link, drops, scene, limits, std::move(coalesce)));
  } catch (const std::exception& e) {
    return Error{Error::Cause::io, std::string("NATS transport: ") + e.what()};
  }
}

}  // namespace mr::net
