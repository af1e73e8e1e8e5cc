#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mr/codec/control.h"
#include "mr/core/frame.h"
#include "mr/core/log.h"
#include "mr/core/trace.h"
#include "mr/net/outbox.h"

/// Nodes as step functions over values: no socket and no thread inside, and the time is an
/// argument. What reaches a node comes as Arrivals, what it says goes out as Asks and packets. An
/// executor (mr/runtime) carries both: in virtual time, or on threads.
namespace mr::node {

/// A request to one of the nodes whose packets a node takes.
struct Ask {
  std::size_t input = 0;  ///< place in Task::inputs()
  codec::Control request;
};

/// What reached a node since its last step, oldest first.
struct Arrivals {
  struct Packet {
    std::size_t input = 0;
    net::Message bytes;
  };
  /// To one of its asks.
  struct Answer {
    std::size_t input = 0;
    net::Message bytes;
    TimePoint asked{}, came{};
  };
  std::vector<Packet> packets;
  std::vector<Answer> answers;
  Duration busy{};  ///< that the node has been at one packet: the last one, or the one under way

  bool empty() const { return packets.empty() && answers.empty(); }
};

/// What a node has done since it started, and how it is now.
struct NodeStats {
  struct Viewers {
    std::size_t watching = 0;
    std::uint64_t sent_bytes = 0;
    std::size_t unread_bytes = 0;
  };
  std::string id;
  std::uint64_t frames = 0;                         ///< packets sent; of the gateway: taken
  std::map<std::string, std::uint64_t> drops = {};  ///< by "<slow or broken side>: <cause>"
  std::map<std::string, std::vector<double>> stages_ms = {};
  std::uint64_t bytes = 0;                             ///< of these packets
  std::map<std::string, bool> inputs = {};             ///< whether they bring captures, by name
  std::map<std::string, double> clock_offsets_s = {};  ///< of inputs, where worth telling
  bool is_silent = false;                              ///< nothing comes at all
  std::optional<Viewers> viewers = {};                 ///< of the gateway
};

/// Where a node's lines for people go. Any thread; may be empty.
struct NodeLog {
  std::function<void(LogLevel level, const std::string& text)> say;
  DropCounter::Listener dropped;  ///< of everything that the node loses

  void tell(const std::string& text) const {
    if (say) say(LogLevel::info, text);
  }
  void warn(const std::string& text) const {
    if (say) say(LogLevel::warning, text);
  }
  void drop(const std::string& place, const Error& error) const {
    if (dropped) dropped(place, error);
  }
};

/// What a node does. Its packets are made in two halves, begin() and finish(), which two threads
/// may run, so that two packets are under way at once. step(), is_ready(), due() and begin() belong
/// to the first thread, answer() and stats() to any.
class Task {
 public:
  /// A packet between its two halves.
  struct Work {
    virtual ~Work() = default;
  };
  using Bytes = std::vector<std::byte>;

  virtual ~Task() = default;
  virtual const std::string& id() const = 0;
  /// The nodes whose packets it takes.
  virtual std::vector<std::string> inputs() const { return {}; }

  /// Takes what arrived, and does what the time brings. Returns what to ask the inputs.
  virtual std::vector<Ask> step(const Arrivals& arrivals, TimePoint now) = 0;

  /// What the node says to a request of a consumer; empty: nothing.
  virtual Bytes answer(const codec::Control& request, TimePoint now) = 0;

  /// Whether a packet can be begun now; if not, when that is to be asked again though nothing
  /// arrives.
  virtual bool is_ready(TimePoint /*now*/) { return false; }
  virtual std::optional<TimePoint> due() const { return std::nullopt; }
  /// The first half; null: it came to nothing, which was counted and told.
  virtual std::unique_ptr<Work> begin(TimePoint /*now*/) { return nullptr; }
  /// Words to the inputs that what they brought was taken for this packet.
  virtual std::vector<Ask> taken(const Work& /*work*/) const { return {}; }
  /// The second half: the packet's bytes; nothing as begin(). `first_part_done` is called once the
  /// stages that use every core are over: on one machine, the inputs' next frames fit in from
  /// there.
  virtual std::optional<Bytes> finish(Work& /*work*/,
                                      const std::function<void()>& /*first_part_done*/) {
    return std::nullopt;
  }
  /// No packet will follow.
  virtual bool has_ended() const { return false; }

  /// Called once, before the first step: `wake` asks for a step, on any thread.
  virtual void wake_by(std::function<void()> /*wake*/) {}

  virtual NodeStats stats(TimePoint now) const = 0;
};

}  // namespace mr::node
