#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "mr/codec/control_pacing.h"
#include "mr/codec/head.h"
#include "mr/codec/receiver.h"

namespace mr::codec {

/// A node's answer to a request for chunks. Errors as decode_chunks(); unsupported: why the node
/// refused the request.
Result<std::vector<EncodedChunk>> read_answer(std::span<const std::byte> answer);

/// The receiving end of one node's stream, from bytes to decoded captures: packets in their order
/// (HeadReader), chunks and pictures (Receiver), and what to ask the node for (ControlPacing).
/// Mergers, clients and renderers all receive with it. No socket, thread or clock inside.
class StreamReceiver {
 public:
  /// Of whatever node sends first. `lattice`: the scene's.
  explicit StreamReceiver(const Lattice& lattice) : lattice_(lattice), receiver_(lattice) {}
  /// Of one node's packets only.
  StreamReceiver(const Lattice& lattice, std::string scene, std::string node)
      : lattice_(lattice), heads_(std::move(scene), std::move(node)), receiver_(lattice) {}

  /// The packet in some bytes, whole and in its order; errors as HeadReader::read(). Where the node
  /// began afresh, nothing of before holds. The caller may check and change the packet, and then
  /// gives it to accept().
  Result<Packet> read(std::span<const std::byte> bytes, TimePoint now);
  /// Whether the packet read last begins afresh.
  bool began_afresh() const { return heads_.began_afresh(); }

  /// Decodes a packet; what was wrong in it, one entry each (Receiver::accept).
  std::vector<Error> accept(const Packet& packet) { return receiver_.accept(packet); }
  /// Decodes the node's answer to a request for chunks; what was wrong in it, one entry each.
  std::vector<Error> take_answer(std::span<const std::byte> answer);

  /// A key frame is wanted of a stream though it can be decoded.
  void want_key_frame(StreamId stream) { key_frames_wanted_.insert(stream); }
  /// What to ask the node for now; empty where nothing is lacking, or was asked for just now.
  Control wanted(TimePoint now);

  const Receiver& decoded() const { return receiver_; }

 private:
  Lattice lattice_;
  HeadReader heads_;
  Receiver receiver_;
  ControlPacing pacing_;
  std::set<StreamId> key_frames_wanted_;  ///< beside those that the receiver waits for
};

}  // namespace mr::codec
