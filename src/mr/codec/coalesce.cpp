#include "mr/codec/coalesce.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "mr/codec/packet_codec.h"
#include "mr/core/assert.h"

namespace mr::codec {

bool can_fold(const Packet& older, const Packet& newer) {
  return older.scene == newer.scene && older.node == newer.node && older.epoch == newer.epoch &&
         newer.sequence > older.sequence && newer.sequence - newer.coalesced <= older.sequence + 1;
}

namespace {

/// Whether the two, folded, are within all limits.
bool has_room(const Packet& older, const Packet& newer) {
  constexpr std::size_t kOverhead = 128;  // bytes, of a chunk or unit
  const PacketLimits limits;
  std::size_t bytes = limits.packet_bytes / 16 + 24 * newer.manifest.size();  // head, views
  std::map<std::uint32_t, std::size_t> units;
  for (const Packet* packet : {&older, &newer}) {
    for (const TextureUnit& unit : packet->textures)
      bytes += unit.data.size() + kOverhead, ++units[unit.stream];
    for (const EncodedChunk& chunk : packet->chunks)
      if (std::binary_search(newer.manifest.begin(), newer.manifest.end(), chunk.key))
        bytes += chunk.payload.size() + kOverhead;
  }
  const bool few = std::all_of(units.begin(), units.end(),
                               [](const auto& stream) { return stream.second <= kMaxFoldedUnits; });
  return few && older.textures.size() + newer.textures.size() <= limits.textures &&
         bytes <= limits.packet_bytes;
}

}  // namespace

Packet fold(Packet older, Packet newer) {
  MR_ASSERT(can_fold(older, newer));
  std::map<ChunkKey, EncodedChunk> chunks;
  for (Packet* packet : {&older, &newer})
    for (EncodedChunk& chunk : packet->chunks)
      if (std::binary_search(newer.manifest.begin(), newer.manifest.end(), chunk.key)) {
        const ChunkKey key = chunk.key;
        chunks.insert_or_assign(key, std::move(chunk));
      }
  newer.chunks.clear();
  for (auto& [key, chunk] : chunks) newer.chunks.push_back(std::move(chunk));

  std::move(newer.textures.begin(), newer.textures.end(), std::back_inserter(older.textures));
  newer.textures = std::move(older.textures);
  newer.coalesced = static_cast<std::uint32_t>(newer.sequence - (older.sequence - older.coalesced));
  return newer;
}

Packet coalesce(std::span<Packet> packets) {
  MR_ASSERT(!packets.empty());
  Packet out = std::move(packets.back());
  for (std::size_t i = packets.size() - 1; i-- > 0;) {
    if (!can_fold(packets[i], out) || !has_room(packets[i], out)) break;
    out = fold(std::move(packets[i]), std::move(out));
  }
  return out;
}

}  // namespace mr::codec
