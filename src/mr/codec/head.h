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

/// The sending end of a node's packets: tells each by its difference to a base, the head of an
/// earlier packet, and brings the base itself now and then. A base is brought by the first packets
/// that build on it, so that only who loses all of these has to ask; whatever else is lost does no
/// harm. One thread writes; ask_whole() is for any.
class HeadWriter {
 public:
  static constexpr std::uint64_t kWholeEvery = 30;  ///< packets, at the latest
  static constexpr int kBroughtBy = 3;              ///< packets in a row bring a new base

  /// The bytes of the node's next packet. Its `streams` are filled in from the units that were
  /// written.
  std::vector<std::byte> write(Packet packet);

  /// Somebody lacks the base: the next packets bring it.
  void ask_whole() { asked_ = true; }

 private:
  void note_streams(Packet& packet);

  std::shared_ptr<const Packet> base_;
  std::uint64_t brought_ = 0;  ///< sequence of the packet that brought it last
  int to_bring_ = 0;
  std::map<StreamId, std::uint32_t> serials_;  ///< of each stream's newest unit
  std::atomic<bool> asked_ = false;
};

/// The receiving end: complete packets out of what a HeadWriter wrote, with losses and folds on the
/// way, and in their order (PacketOrder).
class HeadReader {
 public:
  HeadReader() = default;
  /// Of this node's packets only: another's must not replace its base.
  HeadReader(std::string scene, std::string node)
      : scene_(std::move(scene)), node_(std::move(node)) {}

  /// Errors as decode_packet(); invalid: another node's, or not after the ones before.
  /// not_found: the base did not come; lacks_base() tells so until one does.
  /// `now` may stay the same where no time passes, as in lockstep.
  Result<Packet> read(std::span<const std::byte> bytes, TimePoint now = {});
  Result<Packet> read(PacketMessage message, TimePoint now = {});

  /// Whether the packet just read begins afresh: what was decoded before it does not hold.
  bool began_afresh() const { return began_afresh_; }

  /// Whether the node should be asked for a whole head.
  bool lacks_base() const { return lacks_base_; }

  /// What the newest packet was built on; null before the first.
  const std::shared_ptr<const Packet>& base() const { return base_; }

 private:
  Status check_node(const Packet& base) const;
  std::shared_ptr<const Packet> base_for(const PacketMessage& message) const;

  std::optional<std::string> scene_, node_;
  PacketOrder order_;
  std::shared_ptr<const Packet> base_;
  bool lacks_base_ = false;
  bool is_afresh_ = false;  ///< since the last packet that was read
  bool began_afresh_ = false;
};

}  // namespace mr::codec
