#include "mr/codec/chunk_cache.h"

#include "mr/core/assert.h"

namespace mr::codec {

void ChunkCache::put(std::shared_ptr<const EncodedChunk> chunk) {
  MR_ASSERT(chunk != nullptr);
  const ChunkKey key = chunk->key;
  entries_[key] = {std::move(chunk), manifests_};
}

void ChunkCache::keep(std::span<const ChunkKey> manifest) {
  ++manifests_;
  for (const ChunkKey& key : manifest)
    if (const auto it = entries_.find(key); it != entries_.end())
      it->second.last_named = manifests_;
  std::erase_if(entries_, [&](const auto& item) {
    return manifests_ - item.second.last_named >= kManifestsKept;
  });
}

std::shared_ptr<const EncodedChunk> ChunkCache::find(const ChunkKey& key) const {
  const auto it = entries_.find(key);
  return it == entries_.end() ? nullptr : it->second.chunk;
}

}  // namespace mr::codec
