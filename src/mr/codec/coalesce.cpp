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
  std::size_t first = packets.size() - 1, units = packets[first].textures.size();
  while (first > 0 && can_fold(packets[first - 1], packets[first])) {
    units += packets[first - 1].textures.size();
    if (units > PacketLimits{}.textures) break;
    --first;
  }
  Packet out = std::move(packets[first]);
  for (std::size_t i = first + 1; i < packets.size(); ++i)
    out = fold(std::move(out), std::move(packets[i]));
  return out;
}

}  // namespace mr::codec
