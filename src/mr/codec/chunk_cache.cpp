#include "mr/codec/chunk_cache.h"

#include <utility>

namespace mr::codec {

void ChunkCache::put(EncodedChunk chunk) {
  const ChunkKey key = chunk.key;
  const std::lock_guard lock(mutex_);
  entries_[key] = {std::move(chunk), manifests_};
}

void ChunkCache::keep(std::span<const ChunkKey> manifest) {
  const std::lock_guard lock(mutex_);
  ++manifests_;
  for (const ChunkKey& key : manifest)
    if (const auto it = entries_.find(key); it != entries_.end())
      it->second.last_named = manifests_;
  std::erase_if(entries_, [&](const auto& item) {
    return manifests_ - item.second.last_named >= kManifestsKept;
  });
}

std::optional<EncodedChunk> ChunkCache::find(const ChunkKey& key) const {
  const std::lock_guard lock(mutex_);
  const auto it = entries_.find(key);
  return it == entries_.end() ? std::nullopt : std::optional(it->second.chunk);
}

std::size_t ChunkCache::size() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

}  // namespace mr::codec
