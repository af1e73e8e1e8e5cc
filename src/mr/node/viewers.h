#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/request.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/net/outbox.h"

namespace mr::node {

/// What the gateway knows of its viewers, and decides to send them (docs/wire-format.md,
/// WebSocket): a newcomer starts with every chunk and a key frame; at most `kInFlight` packets are
/// on their way to a viewer, what comes meanwhile is folded; a viewer that falls far behind starts
/// anew. No socket, thread or clock inside.
class Viewers {
 public:
  using Id = std::uint64_t;
  using Send = std::pair<Id, net::Message>;

  static constexpr int kInFlight = 2;
  static constexpr std::size_t kMaxWaiting = 30;  ///< packets; a viewer with more starts anew
  static constexpr Duration kKeyFrameEvery = std::chrono::milliseconds(500);
  static constexpr Duration kChunksEvery = std::chrono::milliseconds(100);
  static constexpr Duration kAnswerEvery = std::chrono::milliseconds(100);  ///< per viewer

  void opened(Id viewer);
  void closed(Id viewer);

  /// Takes a packet of the root. Returns what to send now.
  std::vector<Send> packet(Packet packet, net::Message bytes);
  /// Takes the root's answer to a request for chunks.
  void take_chunks(std::vector<EncodedChunk> chunks);
  /// The viewer has shown, or given up, the packet with this sequence.
  std::vector<Send> shown(Id viewer, std::uint64_t sequence);
  /// A viewer's request: the answer, if there is one. Whoever asks again too soon gets none.
  std::optional<net::Message> asked(Id viewer, const codec::Request& request, TimePoint now);

  /// What to ask the root for now: chunks that are missing, a key frame that somebody waits for.
  codec::Request wanted(TimePoint now);

  /// The newest sequence that a viewer can follow: all of it where nobody watches. The root need
  /// not run ahead of it.
  std::optional<std::uint64_t> taken() const;

  std::size_t size() const { return viewers_.size(); }
  /// Packets that were folded, and viewers that had to start anew.
  std::map<std::string, std::uint64_t> drops() const;

 private:
  struct Waiting {
    std::shared_ptr<const Packet> packet;
    net::Message bytes;
  };
  struct Viewer {
    bool fresh = true;  // waits for a key frame
    std::deque<std::uint64_t> in_flight;
    std::vector<Waiting> waiting;
    std::optional<TimePoint> answered;
  };

  void take_head(const std::shared_ptr<const Packet>& packet);
  bool complete() const;
  net::Message refresh(const Packet& packet) const;
  std::optional<Send> flush(Id id, Viewer& viewer);

  std::map<Id, Viewer> viewers_;
  std::shared_ptr<const Packet> newest_;
  std::map<ChunkKey, std::shared_ptr<const EncodedChunk>> chunks_;  // of the newest manifest
  bool key_frame_wanted_ = false;
  std::optional<TimePoint> key_frame_asked_, chunks_asked_;
  std::uint64_t folded_ = 0, restarted_ = 0, impatient_ = 0;
};

}  // namespace mr::node
