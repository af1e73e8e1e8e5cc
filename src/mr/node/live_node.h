#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "mr/codec/request.h"
#include "mr/core/frame_source.h"
#include "mr/core/scene.h"
#include "mr/net/outbox.h"
#include "mr/net/transport.h"
#include "mr/node/flow.h"
#include "mr/node/gatherer.h"
#include "mr/node/live_source.h"
#include "mr/node/merge_node.h"
#include "mr/node/sensor_node.h"

namespace mr::node {

/// What the running nodes of one process share.
struct LiveContext {
  const Scene* scene = nullptr;         ///< outlives the nodes
  net::Transport* transport = nullptr;  ///< outlives the nodes
  int threads = 0;                      ///< for the stages' loops; 0: all cores
  /// Packets of a node begun and not yet taken by its consumer. 1: all nodes share one machine, and
  /// what a merger gathered counts as taken when it is merged; more: machines of their own.
  int frames_ahead = 2;
  std::function<void(const std::string&)> log = [](const std::string&) {};  ///< one line each
};

/// What a node has done since it started.
struct LiveStats {
  std::string id;
  std::uint64_t frames = 0;                    ///< packets sent
  std::map<std::string, std::uint64_t> drops;  ///< by "<slow or broken side>: <cause>"
  std::map<std::string, std::vector<double>> stages_ms;
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
                            DropCounter& drops) {
  const auto request = codec::decode_request(question);
  if (!request) {
    drops.count("requests to " + node.id(), request.error());
    return nullptr;
  }
  if (request->taken) credit.taken(*request->taken);
  auto bytes = node.answer(*request);
  return bytes.empty() ? nullptr : std::make_shared<const std::vector<std::byte>>(std::move(bytes));
}

/// A sensor node: one thread takes the newest frame and reconstructs its surface, another codes and
/// sends it.
class LiveSensor final : public LiveNode {
 public:
  LiveSensor(const LiveContext& context, std::uint32_t sensor, std::unique_ptr<FrameSource> source);
  LiveStats stats() const override;

 private:
  void reconstruct_frames(const std::stop_token& stop);
  void code_frames(const std::stop_token& stop);
  net::Message answer(std::span<const std::byte> question);

  LiveContext context_;
  SensorNode node_;
  LiveSource source_;
  Credit credit_;
  Handoff<SensorNode::Reconstructed> reconstructed_;
  std::atomic<std::uint64_t> frames_ = 0, skipped_ = 0;
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
  void receive(const std::stop_token& stop);
  void receive_what_waits(TimePoint now);
  void hand_over(const std::stop_token& stop, TimePoint now);
  void acknowledge(const Gathered& gathered);
  void ask(std::size_t input, const codec::Request& request);
  void merge(const std::stop_token& stop);
  net::Message answer(std::span<const std::byte> question);

  LiveContext context_;
  MergeNode node_;
  Credit credit_;
  std::shared_ptr<Signal> signal_ = std::make_shared<Signal>();  // late answers may outlive us
  std::vector<std::shared_ptr<Inbox>> inboxes_;
  Handoff<Gathered> gathered_;
  std::atomic<bool> key_frames_wanted_ = false;
  std::atomic<std::uint64_t> frames_ = 0;
  DropCounter drops_;
  std::unique_ptr<net::Subscription> service_;
  std::vector<std::unique_ptr<net::Subscription>> subscriptions_;
  std::jthread receives_, merges_;  // last: they use what is above
};

}  // namespace mr::node
