#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/lattice.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"

namespace mr::codec {

/// The receiving end of one node's packets: keeps decoded chunks and pictures, and gives a scene
/// when everything that the newest manifest names is there. A packet without a unit of a stream
/// shows the picture that it had; a unit that was lost makes its stream alone wait for a key frame.
/// No socket, thread or clock inside.
/// Chunks are decoded in parallel within the caller's arena.
class Receiver {
 public:
  explicit Receiver(const Lattice& lattice);
  ~Receiver();
  Receiver(Receiver&&) noexcept;
  Receiver& operator=(Receiver&&) noexcept;

  /// Takes a packet. Broken chunks and access units are reported and left out (a chunk then counts
  /// as missing, a stream waits for a key frame); an older packet than the newest is refused
  /// (invalid). A new epoch, or another node, starts afresh. Returns what was wrong, one entry
  /// each.
  std::vector<Error> accept(const Packet& packet);

  /// Whether accept() would refuse the packet because a newer one of the same node was taken.
  bool is_stale(const Packet& packet) const;

  /// Of the newest packet that was accepted.
  std::optional<std::uint64_t> newest_sequence() const;

  /// What the newest manifest names and the receiver lacks.
  std::vector<ChunkKey> missing() const;

  /// Takes a chunk that was asked for.
  Status provide(const EncodedChunk& chunk);

  /// Streams that wait for a key frame.
  std::vector<StreamId> streams_waiting() const;

  /// The chunks of the newest manifest, once none is missing; pictures may still be waited for.
  std::optional<std::vector<std::shared_ptr<const Chunk>>> mesh() const;

  /// The newest capture, once it is whole: nothing is missing and every stream that a view uses has
  /// a picture of the view's layout.
  std::optional<DecodedScene> scene() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::codec
