#include "mr/net/emulated_transport.h"

#include <algorithm>
#include <chrono>

namespace mr::net {
namespace {

constexpr Duration kAnswerTimeout = std::chrono::seconds(2);  // as of every transport

/// Transmission time of `bytes`.
Duration at_rate(std::size_t bytes, double bytes_per_s) {
  if (bytes_per_s <= 0) return {};
  return std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(static_cast<double>(bytes) / bytes_per_s));
}

}  // namespace

EmulatedTransport::Link& EmulatedTransport::link(const std::string& node, Direction direction) {
  const auto found = links_.find({node, direction});
  if (found != links_.end()) return found->second;
  Link made{every_link_, std::mt19937_64(every_link_.seed + links_.size()), {}};
  return links_.emplace(std::pair(node, direction), std::move(made)).first->second;
}

void EmulatedTransport::set_link(const std::string& node, const LinkConfig& config) {
  for (const Direction direction : {Direction::from_node, Direction::to_node})
    link(node, direction).config = config;
}

void EmulatedTransport::send(const std::string& node, Direction direction, std::size_t bytes,
                             std::function<void()> arrive) {
  Link& way = link(node, direction);
  const Duration backlog = std::max(way.idle_at - now_, Duration{});
  const std::size_t room = way.config.queue_bytes;
  if (room > 0 &&
      backlog + at_rate(bytes, way.config.bytes_per_s) > at_rate(room, way.config.bytes_per_s)) {
    ++drops_[node + ": no room in the queue of its link"];
    return;
  }
  way.idle_at = now_ + backlog + at_rate(bytes, way.config.bytes_per_s);
  const double drawn = static_cast<double>(way.random() >> 11) * 0x1p-53;
  if (drawn < way.config.loss) {
    ++drops_[node + ": lost on its link"];
    return;
  }
  under_way_.emplace(way.idle_at + way.config.delay, std::move(arrive));
}

void EmulatedTransport::advance(TimePoint now) {
  while (!under_way_.empty() && under_way_.begin()->first <= now) {
    now_ = std::max(now_, under_way_.begin()->first);
    const auto arrive = std::move(under_way_.extract(under_way_.begin()).mapped());
    arrive();
  }
  now_ = now;
}

void EmulatedTransport::publish(const std::string& node, Message packet) {
  if (!packet) return;
  for (const auto& callback : packets_.of(node))
    send(node, Direction::from_node, packet->size(), [callback, packet] { (*callback)(packet); });
}

std::unique_ptr<Subscription> EmulatedTransport::subscribe(const std::string& node,
                                                           std::function<void(Message)> on_packet) {
  return packets_.add(node, std::move(on_packet));
}

void EmulatedTransport::request(const std::string& node, Message message,
                                std::function<void(Message)> on_answer) {
  if (!message) return;
  const TimePoint asked = now_;
  send(node, Direction::to_node, message->size(), [this, node, message, on_answer, asked] {
    const Message answer = answer_from(answers_, node, *message);
    if (!answer || !on_answer) return;
    send(node, Direction::from_node, answer->size(), [this, answer, on_answer, asked] {
      if (now_ - asked <= kAnswerTimeout) on_answer(answer);
    });
  });
}

std::unique_ptr<Subscription> EmulatedTransport::serve(
    const std::string& node, std::function<Message(std::span<const std::byte>)> answer) {
  return answers_.add(node, std::move(answer));
}

}  // namespace mr::net
