#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/packet_message.h"
#include "mr/codec/packet_order.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"

namespace mr::codec {

/// Sending end of the delta coding of packet heads: each packet is written as its difference to a
/// base, the head of an earlier packet. The first packets that refer to a new base contain it, so
/// only a receiver that loses all of these must request it; other losses do no harm. One thread
/// writes; ask_whole() may be called from any thread.
///
/// Every packet tells again what has changed since the base. Once that took as many keys as a new
/// base takes, there is one.
class HeadWriter {
 public:
  static constexpr std::uint64_t kWholeEvery = 30;  ///< packets, at the latest
  static constexpr int kBroughtBy = 3;  ///< consecutive packets that contain a new base, usually

  /// Encodes the node's next packet. Its field `streams` is set from the texture units written so
  /// far.
  std::vector<std::byte> write(Packet packet);

  /// Whether the packet of this sequence will contain a base, as far as can be told before it is
  /// written. The writing thread.
  bool is_base_due(std::uint64_t sequence) const {
    return to_bring_ > 0 || asked_ || !base_ || sequence - brought_ >= kWholeEvery ||
           has_repeated_much(repeated_ + repeated_lately_);
  }

  /// One packet alone contains a new base: fewer bytes, and who loses it has to ask. Before the
  /// first write().
  void bring_once() { brought_by_ = 1; }

  /// A receiver lacks the base: the next packets contain it.
  void ask_whole() { asked_ = true; }

 private:
  void note_streams(Packet& packet);
  void note_repeated(const PacketChange& change, const std::vector<ChunkKey>& manifest);
  bool has_repeated_much(std::size_t keys) const {
    return keys > static_cast<std::size_t>(brought_by_) * manifest_.size();
  }

  std::shared_ptr<const Packet> base_;
  std::vector<ChunkKey> manifest_;  ///< of the last packet
  // Keys, of changes that packets since the base told again: of all, of the last one.
  std::size_t repeated_ = 0, repeated_lately_ = 0;
  std::uint64_t brought_ = 0;  ///< sequence of the last packet that contained it
  int to_bring_ = 0, brought_by_ = kBroughtBy;
  std::map<StreamId, std::uint32_t> serials_;  ///< serial of each stream's newest unit
  std::atomic<bool> asked_ = false;
};

/// Receiving end: reconstructs complete packets from the bytes of a HeadWriter, some of which may
/// be lost or folded on the way, and enforces their order (PacketOrder).
class HeadReader {
 public:
  HeadReader() = default;
  /// Accepts the packets of this node only.
  HeadReader(std::string scene, std::string node)
      : scene_(std::move(scene)), node_(std::move(node)) {}

  /// Errors as decode_packet(); invalid, too: a packet of another node, or one out of order;
  /// not_found: its base was lost, and lacks_base() is true until a base arrives. `now` may stay
  /// the same from call to call, as in lockstep.
  Result<Packet> read(std::span<const std::byte> bytes, TimePoint now = {});
  Result<Packet> read(PacketMessage message, TimePoint now = {});

  /// Whether the packet just read starts a new stream of packets: everything decoded before it is
  /// invalid.
  bool began_afresh() const { return began_afresh_; }

  /// Whether a complete head must be requested from the node.
  bool lacks_base() const { return lacks_base_; }

  /// The base of the newest packet; null before the first packet.
  const std::shared_ptr<const Packet>& base() const { return base_; }

 private:
  Status check_node(const Packet& base) const;
  std::shared_ptr<const Packet> base_for(const PacketMessage& message) const;

  std::optional<std::string> scene_, node_;
  PacketOrder order_;
  std::shared_ptr<const Packet> base_;
  bool lacks_base_ = false;
  bool is_afresh_ = false;  ///< pending: a restart was seen, no packet read since
  bool began_afresh_ = false;
};

}  // namespace mr::codec
