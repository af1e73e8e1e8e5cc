#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/chunk.h"

namespace mr::codec {

/// What a node holds for receivers that lack a chunk: late joiners, losses and restarts are this
/// one case. Holds what the newest manifests name, and forgets a chunk once
/// `kManifestsKept` manifests went by without it. Thread-safe: requests come on other threads.
class ChunkCache {
 public:
  static constexpr std::uint64_t kManifestsKept = 30;

  void put(EncodedChunk chunk);
  /// Marks what is live, and forgets what has not been for long.
  void keep(std::span<const ChunkKey> manifest);
  std::optional<EncodedChunk> find(const ChunkKey& key) const;  ///< none when forgotten
  std::size_t size() const;

 private:
  struct Entry {
    EncodedChunk chunk;
    std::uint64_t last_named = 0;
  };
  mutable std::mutex mutex_;
  std::map<ChunkKey, Entry> entries_;
  std::uint64_t manifests_ = 0;
};

}  // namespace mr::codec
