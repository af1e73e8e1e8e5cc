#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "mr/codec/request.h"
#include "mr/core/frame_source.h"
#include "mr/core/log.h"
#include "mr/core/scene.h"
#include "mr/net/outbox.h"
#include "mr/net/transport.h"
#include "mr/node/clock_offset.h"
#include "mr/node/flow.h"
#include "mr/node/gatherer.h"
#include "mr/node/live_source.h"
#include "mr/node/merge_node.h"
#include "mr/node/presence.h"
#include "mr/node/request_limits.h"
#include "mr/node/sensor_node.h"
#include "mr/node/stamp_check.h"

namespace mr::node {

/// What a node has done since it started, and how it is now.
struct LiveStats {
  struct Viewers {
    std::size_t watching = 0;
    std::uint64_t sent_bytes = 0;
    std::size_t unread_bytes = 0;
  };
  std::string id;
  std::uint64_t frames = 0;                    ///< packets sent; of the gateway: taken
  std::map<std::string, std::uint64_t> drops;  ///< by "<slow or broken side>: <cause>"
  std::map<std::string, std::vector<double>> stages_ms;
  std::uint64_t bytes = 0;                             ///< of these packets
  std::map<std::string, bool> inputs = {};             ///< whether they bring captures, by name
  std::map<std::string, double> clock_offsets_s = {};  ///< of inputs, where worth telling
  bool is_silent = false;                              ///< nothing comes at all
  std::optional<Viewers> viewers = {};                 ///< of the gateway
};

/// What the running nodes of one process share.
struct LiveContext {
  const Scene* scene = nullptr;         ///< outlives the nodes
  net::Transport* transport = nullptr;  ///< outlives the nodes
  int threads = 0;                      ///< for the stages' loops; 0: all cores
  /// Packets of a node begun and not yet taken by its consumer. 1: all nodes share one machine, and
  /// what a merger gathered counts as taken when it is merged; more: machines of their own.
  int frames_ahead = 2;
  Log log = [](const LogLine&) {};
  /// Of all nodes of this process. Any thread.
  std::function<std::vector<LiveStats>()> stats = [] { return std::vector<LiveStats>{}; };
  std::filesystem::path state_folder = {};  ///< for what is kept between runs; empty: nowhere
  /// Sensors of this process whose recordings have ended.
  std::shared_ptr<std::atomic<std::size_t>> ended = std::make_shared<std::atomic<std::size_t>>(0);

  /// One line of a node for people.
  void warn(const std::string& node, const std::string& text) const {
    log({LogLevel::warning, node, text});
  }
  void tell(const std::string& node, const std::string& text) const {
    log({LogLevel::info, node, text});
  }
};

/// A node of a scene that runs on threads of its own until it is destroyed.
class LiveNode {
 public:
  virtual ~LiveNode() = default;
  virtual LiveStats stats() const = 0;
};

/// What a node says to a request: null when it has nothing to give. What was taken is credited.
template <typename Node>
net::Message answer_request(std::span<const std::byte> question, Node& node, Credit& credit,
                            RequestLimits& limits, DropCounter& drops) {
  const auto request = codec::decode_request(question);
  if (!request) {
    drops.count("requests to " + node.id(), request.error());
    return nullptr;
  }
  const TimePoint now = wall_time();
  if (request->taken) credit.taken(*request->taken);
  codec::Request admitted = limits.admit(*request, now);
  if (request->time) admitted.chunks.clear();  // it is answered by the time alone
  auto bytes = node.answer(admitted);
  if (request->time) bytes = codec::encode_time(now);
  if (bytes.empty()) return nullptr;
  limits.answered(bytes.size());
  return std::make_shared<const std::vector<std::byte>>(std::move(bytes));
}

/// A sensor node: one thread takes the newest frame and reconstructs its surface, another codes and
/// sends it.
class LiveSensor final : public LiveNode {
 public:
  LiveSensor(const LiveContext& context, std::uint32_t sensor, std::unique_ptr<FrameSource> source);
  LiveStats stats() const override;

 private:
  void reconstruct_frames(const std::stop_token& stop);
  void correct_stamp(Frame& frame);
  void code_frames(const std::stop_token& stop);
  net::Message answer(std::span<const std::byte> question);

  LiveContext context_;
  SensorNode node_;
  LiveSource source_;
  Credit credit_;
  RequestLimits limits_;
  StampCheck stamps_;
  Duration stamp_shift_{};  // the reconstructing thread's
  std::atomic<std::int64_t> newest_ns_ = wall_time().time_since_epoch().count();  // came
  Handoff<SensorNode::Reconstructed> reconstructed_;
  std::atomic<std::uint64_t> frames_ = 0, bytes_ = 0, skipped_ = 0, restamped_ = 0;
  DropCounter drops_;
  std::unique_ptr<net::Subscription> service_;
  std::jthread reconstructs_, codes_;  // last: they use what is above
};

/// A merging server: one thread receives, asks for what is missing and brings captures together,
/// another merges and sends.
class LiveMerger final : public LiveNode {
 public:
  /// `background`: chunks of the scene's background model, for the root.
  LiveMerger(const LiveContext& context, const MergerConfig& merger,
             std::vector<EncodedChunk> background = {});
  LiveStats stats() const override;

 private:
  struct Inbox;
  struct Answer {
    net::Message bytes;
    TimePoint asked, came;
  };
  void receive(const std::stop_token& stop);
  void receive_what_waits(TimePoint now);
  void take_answer(std::size_t input, const Answer& answer);
  Duration merging_for(TimePoint now) const;
  void watch_inputs(TimePoint now);
  void hand_over(const std::stop_token& stop, TimePoint now);
  void acknowledge(const Gathered& gathered);
  void ask(std::size_t input, const codec::Request& request);
  void merge(const std::stop_token& stop);
  net::Message answer(std::span<const std::byte> question);

  LiveContext context_;
  MergeNode node_;
  Credit credit_;
  RequestLimits limits_;
  mutable std::mutex watch_mutex_;  // of the next two
  Presence presence_;
  std::vector<ClockOffset> clocks_;  // of the inputs
  std::optional<TimePoint> clocks_asked_;
  std::atomic<std::uint64_t> retimed_ = 0;
  std::atomic<std::int64_t> merge_began_ns_ = 0, merge_took_ns_ = 0;  // 0: none is going on
  std::shared_ptr<Signal> signal_ = std::make_shared<Signal>();       // late answers may outlive us
  std::vector<std::shared_ptr<Inbox>> inboxes_;
  Handoff<Gathered> gathered_;
  std::atomic<bool> key_frames_wanted_ = false;
  std::atomic<std::uint64_t> frames_ = 0, bytes_ = 0;
  DropCounter drops_;
  std::unique_ptr<net::Subscription> service_;
  std::vector<std::unique_ptr<net::Subscription>> subscriptions_;
  std::jthread receives_, merges_;  // last: they use what is above
};

}  // namespace mr::node
