#include "mr/codec/coalesce.h"

#include <gtest/gtest.h>

#include "mr/codec/head.h"
#include "mr/codec/packet_codec.h"

namespace mr::codec {
namespace {

ChunkKey key(int cube, std::uint32_t version) {
  return {{{cube, 0, 0}, kMergedSource}, 0, version};
}

EncodedChunk chunk(int cube, std::uint32_t version) {
  EncodedChunk out;
  out.key = key(cube, version);
  out.triangles = 1;
  out.payload = {std::byte{1}};
  return out;
}

TextureUnit unit(int number) {
  TextureUnit out;
  out.serial = static_cast<std::uint32_t>(number);
  out.width = out.height = 16;
  out.data = {static_cast<std::byte>(number)};
  return out;
}

/// A packet as it travels, with its own head as base.
PacketMessage packet(std::uint64_t sequence, std::vector<ChunkKey> manifest,
                     std::vector<EncodedChunk> chunks) {
  Packet out;
  out.scene = "s", out.node = "n", out.epoch = 1;
  out.sequence = sequence;
  out.captured_at = TimePoint(Duration(static_cast<std::int64_t>(sequence)));
  out.manifest = std::move(manifest);
  out.chunks = std::move(chunks);
  out.textures = {unit(static_cast<int>(sequence))};
  return *decode_message(encode_packet(out));
}

Packet whole(const PacketMessage& message) { return *complete(message, *message.base); }

TEST(Coalesce, NewestManifestNewestPayloadAllUnits) {
  std::vector<PacketMessage> packets = {
      packet(5, {key(0, 1), key(1, 1), key(2, 1)}, {chunk(0, 1), chunk(1, 1), chunk(2, 1)}),
      packet(6, {key(0, 1), key(1, 2)}, {chunk(1, 2)}),
      packet(7, {key(0, 1), key(1, 3)}, {chunk(1, 3)})};
  const Packet out = whole(coalesce(packets));
  EXPECT_EQ(out.sequence, 7u);
  EXPECT_EQ(out.coalesced, 2u);
  EXPECT_EQ(out.captured_at, TimePoint(Duration(7)));
  EXPECT_EQ(out.manifest, (std::vector{key(0, 1), key(1, 3)}));
  ASSERT_EQ(out.chunks.size(), 2u);
  EXPECT_EQ(out.chunks[0].key, key(0, 1));
  EXPECT_EQ(out.chunks[1].key, key(1, 3));
  ASSERT_EQ(out.textures.size(), 3u);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(out.textures[i], unit(5 + i));
}

TEST(Coalesce, FoldedPacketsFoldAgain) {
  std::vector<PacketMessage> first = {packet(1, {}, {}), packet(2, {}, {})};
  std::vector<PacketMessage> second = {packet(3, {}, {}), packet(4, {}, {}), packet(5, {}, {})};
  std::vector<PacketMessage> both = {coalesce(first), coalesce(second)};
  const PacketMessage out = coalesce(both);
  EXPECT_EQ(out.coalesced, 4u);
  EXPECT_EQ(out.textures.size(), 5u);
}

TEST(Coalesce, WhatDoesNotFollowIsGivenUp) {
  std::vector<PacketMessage> gap = {packet(1, {}, {}), packet(3, {}, {}), packet(4, {}, {})};
  PacketMessage out = coalesce(gap);
  EXPECT_EQ(out.coalesced, 1u);
  EXPECT_EQ(out.textures.size(), 2u);

  std::vector<PacketMessage> restarted = {packet(8, {}, {}), packet(0, {}, {}), packet(1, {}, {})};
  restarted[1].epoch = restarted[2].epoch = 2;
  out = coalesce(restarted);
  EXPECT_EQ(out.epoch, 2u);
  EXPECT_EQ(out.coalesced, 1u);
}

TEST(Coalesce, NoMoreUnitsThanAPacketMayHold) {
  std::vector<PacketMessage> packets;
  for (std::uint64_t i = 0; i < 3; ++i) {
    packets.push_back(packet(i, {}, {}));
    packets.back().textures.assign(PacketLimits{}.textures / 2, unit(1));
    packets.back().change.streams.reset();
    for (std::uint32_t stream = 0; TextureUnit & u : packets.back().textures)
      u.stream = StreamId{stream++};
  }
  const PacketMessage out = coalesce(packets);
  EXPECT_EQ(out.coalesced, 1u);
  EXPECT_TRUE(decode_message(encode_message(out)));
}

TEST(Coalesce, NoMoreOfAStreamThanCanBeDecodedSoon) {
  std::vector<PacketMessage> packets;
  for (std::uint64_t i = 0; i < 2 * kMaxFoldedUnits; ++i) packets.push_back(packet(i, {}, {}));
  EXPECT_EQ(coalesce(packets).textures.size(), kMaxFoldedUnits);
}

TEST(Coalesce, NoMoreBytesThanAPacketMayHold) {
  std::vector<PacketMessage> packets;
  for (std::uint64_t i = 0; i < 5; ++i) {
    packets.push_back(packet(i, {}, {}));
    packets.back().textures[0].data = std::vector<std::byte>(PacketLimits{}.packet_bytes / 4);
  }
  const PacketMessage out = coalesce(packets);
  EXPECT_GT(out.textures.size(), 1u);
  EXPECT_LT(encode_message(out).size(), PacketLimits{}.packet_bytes);
}

}  // namespace
}  // namespace mr::codec
