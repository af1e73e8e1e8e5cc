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

/// What a packet's head (all but its payloads and times) has other than its base, an earlier
/// packet's head. Lists are sorted.
struct PacketChange {
  using ViewKey = std::pair<ViewId, Layer>;
  /// New masks of a sensor of the base; nothing: as in the base.
  struct Confirmed {
    SensorId sensor{};
    std::optional<TileMask> depth{}, color{};
    friend bool operator==(const Confirmed&, const Confirmed&) = default;
  };

  std::vector<ChunkKey> removed, added;
  std::vector<ViewKey> removed_views;
  std::vector<View> views;  ///< that are new or another
  std::vector<SensorId> removed_sources;
  std::vector<SourceInfo> sources;  ///< that are new or another, without times
  std::vector<Confirmed> confirmed;
  std::optional<CodingPlan> plan;
  std::optional<std::vector<std::string>> stages;   ///< of all time marks
  std::optional<std::vector<StreamState>> streams;  ///< all of them; else the base's and the units'

  bool empty() const { return *this == PacketChange{}; }
  friend bool operator==(const PacketChange&, const PacketChange&) = default;
};

/// A packet as it travels (docs/wire-format.md, "Head and base"): what its head has other than that
/// of the packet `age` before it, its times, and the payloads.
struct PacketMessage {
  std::uint32_t epoch = 0;
  std::uint64_t sequence = 0;
  std::uint32_t age = 0;  ///< packets since the base
  std::uint32_t coalesced = 0;
  TimePoint captured_at{};
  std::vector<TimePoint> source_times, mark_times;
  /// The base, where this message brings it: a packet without payloads, its times are zero.
  std::shared_ptr<const Packet> base;
  PacketChange change;
  std::vector<EncodedChunk> chunks;
  std::vector<TextureUnit> textures;

  std::uint64_t base_sequence() const { return sequence - age; }
};

/// The streams' states after some units; sorted.
std::vector<StreamState> streams_after(const std::vector<StreamState>& before,
                                       const std::vector<TextureUnit>& units);

/// A packet's head as a base for others: without payloads, all times zero.
std::shared_ptr<const Packet> base_of(const Packet& packet);

/// What `packet` has other than `base`, which is of the same scene and node.
PacketChange change_between(const Packet& base, const Packet& packet);

/// The packet that a message means. invalid: it does not fit its base, or what comes out cannot be.
Result<Packet> complete(PacketMessage message, const Packet& base, const PacketLimits& limits = {});

/// The bytes of a packet that is told by its `change` to `base`; with `bring` they hold the base.
std::vector<std::byte> encode_packet(const Packet& packet, const Packet& base,
                                     const PacketChange& change, bool bring);
std::vector<std::byte> encode_message(const PacketMessage& message);

/// As decode_packet(), before the base is known.
Result<PacketMessage> decode_message(std::span<const std::byte> bytes,
                                     const PacketLimits& limits = {});

}  // namespace mr::codec
