#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/control.h"
#include "mr/core/frame.h"
#include "mr/core/log.h"
#include "mr/core/trace.h"
#include "mr/net/outbox.h"

/// Nodes as step functions over values: no socket and no thread inside, and the time is an
/// argument. A node's input is Arrivals, its output Asks and packets. An executor (mr/runtime)
/// transports both, in virtual time or on threads.
namespace mr::node {

/// A request of a node to one of its inputs.
struct Ask {
  std::size_t input = 0;  ///< index in Task::inputs()
  codec::Control request;
};

/// The messages that reached a node since its last step, oldest first.
struct Arrivals {
  struct Packet {
    std::size_t input = 0;
    net::Message bytes;
  };
  /// An answer to one of its requests.
  struct Answer {
    std::size_t input = 0;
    net::Message bytes;
    TimePoint asked{}, came{};
  };
  std::vector<Packet> packets;
  std::vector<Answer> answers;
  Duration busy{};  ///< time spent on the last packet, or on the current one

  bool empty() const { return packets.empty() && answers.empty(); }
};

/// Counters of a node since it started, and its present state.
struct NodeStats {
  struct Viewers {
    std::size_t watching = 0;
    std::uint64_t sent_bytes = 0;
    std::size_t unread_bytes = 0;
  };
  std::string id;
  std::uint64_t frames = 0;                         ///< packets sent; of the gateway: received
  std::map<std::string, std::uint64_t> drops = {};  ///< by "<slow or broken side>: <cause>"
  std::map<std::string, std::vector<double>> stages_ms = {};
  std::uint64_t bytes = 0;                             ///< of these packets
  std::map<std::string, bool> inputs = {};             ///< whether each delivers captures, by name
  std::map<std::string, double> clock_offsets_s = {};  ///< of inputs; 0: too small to matter
  bool is_silent = false;                              ///< no input delivers anything
  std::optional<Viewers> viewers = {};                 ///< gateway only
};

/// The log of a node. Any thread; the functions may be empty.
struct NodeLog {
  std::function<void(LogLevel level, const std::string& text)> write;
  DropCounter::Listener dropped;  ///< called for everything that the node drops

  void info(const std::string& text) const {
    if (write) write(LogLevel::info, text);
  }
  void warn(const std::string& text) const {
    if (write) write(LogLevel::warning, text);
  }
  void drop(const std::string& place, const Error& error) const {
    if (dropped) dropped(place, error);
  }
};

/// The behaviour of a node. A packet is made in two pipeline stages, begin() and finish(), which
/// may run on two threads, so that two packets are in progress at once. step(), is_ready(), due()
/// and begin() are called on the first thread, finish() and finish_rungs() on the second, answer(),
/// answer_rung() and stats() on any thread.
class Task {
 public:
  /// A packet between its two stages.
  struct Work {
    virtual ~Work() = default;
  };
  using Bytes = std::vector<std::byte>;

  virtual ~Task() = default;
  virtual const std::string& id() const = 0;
  /// The ids of the nodes whose packets it receives.
  virtual std::vector<std::string> inputs() const { return {}; }

  /// Handles arrivals and timers. Returns the requests to the inputs.
  virtual std::vector<Ask> step(const Arrivals& arrivals, TimePoint now) = 0;

  /// The answer to a consumer's request; empty: no answer.
  virtual Bytes answer(const codec::Control& request, TimePoint now) = 0;

  /// is_ready: whether a packet can be begun now. due: if not, the time at which to check again
  /// even if nothing arrives.
  virtual bool is_ready(TimePoint /*now*/) { return false; }
  virtual std::optional<TimePoint> due() const { return std::nullopt; }
  /// First stage. null: no packet; the reason was counted and logged.
  virtual std::unique_ptr<Work> begin(TimePoint /*now*/) { return nullptr; }
  /// Acknowledgements to the inputs whose captures this packet uses.
  virtual std::vector<Ask> taken(const Work& /*work*/) const { return {}; }
  /// Second stage: the packet's bytes; nothing as in begin(). `first_part_done` is called after the
  /// stages that use every core: inputs on the same machine may start on their next frames then.
  virtual std::optional<Bytes> finish(Work& /*work*/,
                                      const std::function<void()>& /*first_part_done*/) {
    return std::nullopt;
  }

  /// The names of streams that it can send beside its own: the same captures at other rates.
  virtual std::vector<std::string> rungs() const { return {}; }
  /// As answer(), to a consumer of a rung.
  virtual Bytes answer_rung(std::size_t /*rung*/, const codec::Control& /*request*/,
                            TimePoint /*now*/) {
    return {};
  }
  /// After finish(): the packets of the rungs that are wanted.
  virtual std::vector<std::pair<std::size_t, Bytes>> finish_rungs(Work& /*work*/,
                                                                  TimePoint /*now*/) {
    return {};
  }

  /// No packet will follow.
  virtual bool has_ended() const { return false; }

  /// Called once, before the first step: `wake` schedules a step and may be called on any thread.
  virtual void wake_by(std::function<void()> /*wake*/) {}

  virtual NodeStats stats(TimePoint now) const = 0;
};

}  // namespace mr::node
