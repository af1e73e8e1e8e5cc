#include "mr/codec/head.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

namespace mr::codec {

/// Sets the packet's `streams`: the newest serial of each stream that a view uses.
void HeadWriter::note_streams(Packet& packet) {
  std::map<StreamId, std::uint32_t> used;
  for (const View& view : packet.views)
    if (const auto known = serials_.find(view.stream); known != serials_.end()) used.insert(*known);
  for (const TextureUnit& unit : packet.textures) used[unit.stream] = unit.serial;
  packet.streams.clear();
  for (const auto& [stream, serial] : used) packet.streams.push_back({stream, serial});
  serials_ = std::move(used);
}

/// Counts the keys of a change that the packet before had, too.
void HeadWriter::note_repeated(const PacketChange& change, const std::vector<ChunkKey>& manifest) {
  std::vector<ChunkKey> other;
  std::ranges::set_symmetric_difference(manifest_, manifest, std::back_inserter(other));
  const std::size_t told = change.removed.size() + change.added.size();
  repeated_lately_ = told - std::min(told, other.size());
  repeated_ += repeated_lately_;
  manifest_ = manifest;
}

std::vector<std::byte> HeadWriter::write(Packet packet) {
  note_streams(packet);
  const bool follows = base_ && base_->scene == packet.scene && base_->node == packet.node &&
                       base_->epoch == packet.epoch && base_->sequence < packet.sequence &&
                       packet.sequence - base_->sequence <= UINT32_MAX;
  PacketChange change;
  if (follows) change = change_between(*base_, packet);
  const bool due = follows && packet.sequence - brought_ >= kWholeEvery;
  note_repeated(change, packet.manifest);
  const bool is_large = change.removed.size() + change.added.size() > packet.manifest.size() ||
                        has_repeated_much(repeated_);
  if (!follows || is_large || (due && !change.empty())) {
    base_ = base_of(packet);
    change = change_between(*base_, packet);
    to_bring_ = brought_by_;
    repeated_ = repeated_lately_ = 0;
  } else if (due) {
    to_bring_ = std::max(to_bring_, 1);
  }
  if (asked_.exchange(false)) to_bring_ = brought_by_;
  const bool bring = to_bring_ > 0;
  if (bring) --to_bring_, brought_ = packet.sequence;
  return encode_packet(packet, *base_, change, bring);
}

Result<Packet> HeadReader::read(std::span<const std::byte> bytes, TimePoint now) {
  auto message = decode_message(bytes);
  if (!message) return message.error();
  return read(*std::move(message), now);
}

Status HeadReader::check_node(const Packet& base) const {
  if ((scene_ && *scene_ != base.scene) || (node_ && *node_ != base.node))
    return Error{Error::Cause::invalid,
                 "packet: is of node '" + base.node + "' of scene '" + base.scene + "'"};
  return {};
}

/// The base of a message; null: it was lost.
std::shared_ptr<const Packet> HeadReader::base_for(const PacketMessage& message) const {
  if (message.base) return message.base;
  const bool fits =
      base_ && base_->epoch == message.epoch && base_->sequence == message.base_sequence();
  return fits ? base_ : nullptr;
}

Result<Packet> HeadReader::read(PacketMessage message, TimePoint now) {
  if (message.base)
    if (const Status ours = check_node(*message.base); !ours) return ours.error();
  const auto base = base_for(message);
  if (!base) {
    lacks_base_ = true;
    return Error{
        Error::Cause::not_found,
        "packet: its base, packet " + std::to_string(message.base_sequence()) + ", did not come"};
  }
  const auto verdict = order_.take(message.epoch, message.sequence, now);
  if (!verdict) return Error{verdict.error().cause, "packet: " + verdict.error().message};
  is_afresh_ |= *verdict == PacketOrder::Verdict::afresh;
  base_ = base, lacks_base_ = false;
  auto packet = complete(std::move(message), *base);
  if (packet) began_afresh_ = std::exchange(is_afresh_, false);
  return packet;
}

}  // namespace mr::codec
