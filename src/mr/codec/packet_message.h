#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/packet_codec.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"

namespace mr::codec {

/// The difference of a packet's head (everything but payloads and times) to its base, the head of
/// an earlier packet. Lists are sorted.
struct PacketChange {
  using ViewKey = std::pair<ViewId, Layer>;
  /// Changed masks of a sensor that the base names; nothing: as in the base.
  struct Confirmed {
    SensorId sensor{};
    std::optional<TileMask> depth{}, color{}, blind{};
    friend bool operator==(const Confirmed&, const Confirmed&) = default;
  };

  std::vector<ChunkKey> removed, added;
  std::vector<ViewKey> removed_views;
  std::vector<View> views;  ///< new or changed
  std::vector<SensorId> removed_sources;
  std::vector<SourceInfo> sources;  ///< new or changed, without times
  std::vector<Confirmed> confirmed;
  std::optional<CodingPlan> plan;
  std::optional<std::vector<std::string>> stages;  ///< names of all time marks
  std::optional<std::vector<StreamState>>
      streams;  ///< all; none: from the base and the texture units

  bool empty() const { return *this == PacketChange{}; }
  friend bool operator==(const PacketChange&, const PacketChange&) = default;
};

/// A packet on the wire (docs/wire-format.md, "Head and base"): the difference of its head to that
/// of the packet `age` before it, its times, and the payloads.
struct PacketMessage {
  std::uint32_t epoch = 0;
  std::uint64_t sequence = 0;
  std::uint32_t age = 0;  ///< packets since the base
  std::uint32_t coalesced = 0;
  TimePoint captured_at{};
  std::vector<TimePoint> source_times, mark_times;
  /// The base, if this message contains it: a packet without payloads whose times are zero.
  std::shared_ptr<const Packet> base;
  PacketChange change;
  std::vector<EncodedChunk> chunks;
  std::vector<TextureUnit> textures;
  std::vector<AlphaPlane> alpha;
  std::vector<FrameFeatures> features;

  std::uint64_t base_sequence() const { return sequence - age; }
};

/// The states of the streams after `units`; sorted.
std::vector<StreamState> streams_after(const std::vector<StreamState>& before,
                                       const std::vector<TextureUnit>& units);

/// A packet's head as a base for later packets: without payloads, all times zero.
std::shared_ptr<const Packet> base_of(const Packet& packet);

/// The difference of `packet` to `base`, which is of the same scene and node.
PacketChange change_between(const Packet& base, const Packet& packet);

/// Applies a message to its base. Error invalid: it does not fit the base, or the result is no
/// valid packet.
Result<Packet> complete(PacketMessage message, const Packet& base, const PacketLimits& limits = {});

/// Encodes a packet as its `change` to `base`; with `bring` the bytes contain the base, too.
std::vector<std::byte> encode_packet(const Packet& packet, const Packet& base,
                                     const PacketChange& change, bool bring);
std::vector<std::byte> encode_message(const PacketMessage& message);

/// As decode_packet(), before the base is known.
Result<PacketMessage> decode_message(std::span<const std::byte> bytes,
                                     const PacketLimits& limits = {});

/// As decode_message(), but the payloads stay where they are: each shares the memory of all
/// `bytes`. For messages that are soon passed on (folding), not for what is kept.
Result<PacketMessage> read_message(const std::shared_ptr<const std::vector<std::byte>>& bytes,
                                   const PacketLimits& limits = {});

}  // namespace mr::codec
