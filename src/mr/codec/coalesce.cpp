#include "mr/codec/coalesce.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "mr/core/assert.h"

namespace mr::codec {
namespace {

bool holds(const std::vector<ChunkKey>& sorted, const ChunkKey& key) {
  return std::binary_search(sorted.begin(), sorted.end(), key);
}

/// Whether the manifest of `newer` names a chunk that is in that of `older`, before it. Where the
/// base is not at hand both build on the same.
bool still_names(const PacketMessage& newer, const PacketMessage& older, const ChunkKey& key) {
  if (holds(newer.change.added, key)) return true;
  if (holds(newer.change.removed, key)) return false;
  return newer.base ? holds(newer.base->manifest, key) : !holds(older.change.added, key);
}

/// Whether the two, folded, are within all limits.
bool has_room(const PacketMessage& older, const PacketMessage& newer) {
  constexpr std::size_t kOverhead = 128;  // bytes, of a chunk, unit or plane
  const PacketLimits limits;
  std::size_t keys = 0;
  for (const PacketMessage* packet : {&older, &newer})
    keys += packet->change.removed.size() + packet->change.added.size() +
            (packet->base ? packet->base->manifest.size() : 0);
  std::size_t bytes = limits.packet_bytes / 16 + 28 * keys;  // head, views
  for (const AlphaPlane& plane : newer.alpha) bytes += plane.data.size() + kOverhead;
  std::map<StreamId, std::size_t> units;
  for (const PacketMessage* packet : {&older, &newer}) {
    for (const TextureUnit& unit : packet->textures)
      bytes += unit.data.size() + kOverhead, ++units[unit.stream];
    for (const EncodedChunk& chunk : packet->chunks)
      if (packet == &newer || still_names(newer, older, chunk.key))
        bytes += chunk.payload.size() + kOverhead;
  }
  const bool few = std::all_of(units.begin(), units.end(),
                               [](const auto& stream) { return stream.second <= kMaxFoldedUnits; });
  return few && older.textures.size() + newer.textures.size() <= limits.textures &&
         bytes <= limits.packet_bytes;
}

bool have_one_base(const PacketMessage& a, const PacketMessage& b) {
  return a.epoch == b.epoch && a.base_sequence() == b.base_sequence();
}

}  // namespace

bool can_fold(const PacketMessage& older, const PacketMessage& newer) {
  const bool one_node =
      !older.base || !newer.base ||
      (older.base->scene == newer.base->scene && older.base->node == newer.base->node);
  return one_node && older.epoch == newer.epoch && newer.sequence > older.sequence &&
         newer.sequence - newer.coalesced <= older.sequence + 1 &&
         (newer.base || have_one_base(older, newer));
}

PacketMessage fold(PacketMessage older, PacketMessage newer) {
  MR_ASSERT(can_fold(older, newer));
  std::map<ChunkKey, EncodedChunk> chunks;
  for (EncodedChunk& chunk : older.chunks)
    if (const ChunkKey key = chunk.key; still_names(newer, older, key))
      chunks.insert_or_assign(key, std::move(chunk));
  for (EncodedChunk& chunk : newer.chunks) {
    const ChunkKey key = chunk.key;
    chunks.insert_or_assign(key, std::move(chunk));
  }
  newer.chunks.clear();
  for (auto& [key, chunk] : chunks) newer.chunks.push_back(std::move(chunk));

  std::move(newer.textures.begin(), newer.textures.end(), std::back_inserter(older.textures));
  newer.textures = std::move(older.textures);
  newer.coalesced = static_cast<std::uint32_t>(newer.sequence - (older.sequence - older.coalesced));
  if (!newer.base && have_one_base(older, newer)) newer.base = std::move(older.base);
  return newer;
}

PacketMessage coalesce(std::span<PacketMessage> packets) {
  MR_ASSERT(!packets.empty());
  PacketMessage out = std::move(packets.back());
  std::size_t i = packets.size() - 1;
  while (i > 0 && can_fold(packets[i - 1], out) && has_room(packets[i - 1], out))
    out = fold(std::move(packets[--i]), std::move(out));
  // What is given up may have brought the base of what is not.
  while (!out.base && i-- > 0)
    if (packets[i].base && have_one_base(packets[i], out)) out.base = packets[i].base;
  return out;
}

}  // namespace mr::codec
