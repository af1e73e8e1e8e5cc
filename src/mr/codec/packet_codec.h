#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/packet.h"
#include "mr/core/result.h"

namespace mr::codec {

/// Caps that are checked before anything is decoded.
struct PacketLimits {
  std::size_t packet_bytes = 64u << 20;
  std::size_t manifest_chunks = 1u << 16;
  std::size_t views = 4096;
  std::size_t textures = 1u << 14;
  int texture_side = 8192;  ///< pixels
  std::uint32_t chunk_triangles = 1u << 20;
  std::uint64_t packet_triangles = 1u << 24;  ///< of all payloads together
  std::size_t marks = 1024;
  std::uint64_t mask_tiles = 1u << 26;    ///< of all masks together
  std::uint64_t alpha_pixels = 1u << 24;  ///< of all alpha planes together
  std::size_t name_bytes = 256;
};

/// The bytes of a packet that can be read without any other: docs/wire-format.md,
/// schema/packet.fbs. What a node sends is written by a HeadWriter.
std::vector<std::byte> encode_packet(const Packet& packet);

/// Verifies and reads bytes that may come from anyone, at any alignment. Errors: corrupt,
/// too_large, invalid (a value that cannot be: poses, rectangles outside their picture, a payload
/// that the manifest does not name, unsorted lists), not_found (it builds on a packet that it does
/// not bring: codec::HeadReader).
Result<Packet> decode_packet(std::span<const std::byte> bytes, const PacketLimits& limits = {});

/// The file identifier of chunks that answer a request; a packet's is in the schema.
inline constexpr const char* kChunksIdentifier = "MRC4";

/// Chunks in answer to a request, sorted by key: docs/wire-format.md, "Request and answer".
std::vector<std::byte> encode_chunks(std::span<const EncodedChunk> chunks);

/// As decode_packet().
Result<std::vector<EncodedChunk>> decode_chunks(std::span<const std::byte> bytes,
                                                const PacketLimits& limits = {});

}  // namespace mr::codec
