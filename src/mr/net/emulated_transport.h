#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>

#include "mr/core/frame.h"
#include "mr/net/registry.h"
#include "mr/net/transport.h"

namespace mr::net {

/// One direction of an emulated link, like Linux netem: messages wait in a queue that is served at
/// a fixed rate, are then delayed, and some are lost.
struct LinkConfig {
  Duration delay{};             ///< of one direction
  double loss = 0;              ///< share of messages, 0 to 1
  double bytes_per_s = 0;       ///< 0: no limit
  std::size_t queue_bytes = 0;  ///< capacity of the queue (tail drop); 0: no limit
  std::uint64_t seed = 1;       ///< of the losses
};

/// All nodes in this process, joined by emulated links, in virtual time. Every node has an uplink
/// for its packets (one copy for each subscriber) and answers, and a downlink for the requests made
/// to it. The same seed gives the same losses. For one thread.
class EmulatedTransport final : public Transport {
 public:
  explicit EmulatedTransport(const LinkConfig& every_link) : every_link_(every_link) {}

  /// Changes both links of a node. Messages under way are not affected.
  void set_link(const std::string& node, const LinkConfig& config);

  /// Advances the virtual time and delivers what arrives until `now`, in the order of arrival.
  void advance(TimePoint now);
  /// The virtual time; in a callback, the time of arrival.
  TimePoint now() const { return now_; }

  void publish(const std::string& node, Message packet) override;
  std::unique_ptr<Subscription> subscribe(const std::string& node,
                                          std::function<void(Message)> on_packet) override;
  void request(const std::string& node, Message message,
               std::function<void(Message)> on_answer) override;
  std::unique_ptr<Subscription> serve(
      const std::string& node, std::function<Message(std::span<const std::byte>)> answer) override;
  std::map<std::string, std::uint64_t> drops() const override { return drops_; }

 private:
  struct Link {
    LinkConfig config;
    std::mt19937_64 random;
    TimePoint idle_at{};  ///< when the queue is empty
  };
  enum class Direction { from_node, to_node };
  Link& link(const std::string& node, Direction direction);
  void send(const std::string& node, Direction direction, std::size_t bytes,
            std::function<void()> arrive);

  LinkConfig every_link_;
  TimePoint now_{};
  std::map<std::pair<std::string, Direction>, Link> links_;
  std::multimap<TimePoint, std::function<void()>> under_way_;  ///< by arrival, then as sent
  PacketRegistry packets_;
  AnswerRegistry answers_;
  std::map<std::string, std::uint64_t> drops_;
};

}  // namespace mr::net
