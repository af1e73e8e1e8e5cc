#include "mr/codec/receiver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "mr/codec/chunk_cache.h"
#include "mr/codec/mesh_codec.h"
#include "mr/codec/packet_codec.h"
#include "mr/kit/video.h"
#include "support/meshes.h"
#include "support/seal.h"
#include "support/sender.h"

namespace mr::codec {
namespace {

using test::Sender;

double mean_difference(const ImageRgb& a, const ImageRgb& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i)
    sum += std::abs(static_cast<double>(a.data[i]) - b.data[i]);
  return sum / static_cast<double>(a.data.size());
}

testing::AssertionResult equals(const std::optional<DecodedScene>& scene, const Sender& sender,
                                std::uint64_t sequence) {
  if (!scene) return testing::AssertionFailure() << "no scene";
  const auto expected = sender.chunks();
  if (scene->chunks.size() != expected.size()) return testing::AssertionFailure() << "chunk count";
  for (std::size_t i = 0; i < expected.size(); ++i)
    if (scene->chunks[i]->key != expected[i].key || scene->chunks[i]->mesh != expected[i].mesh)
      return testing::AssertionFailure() << "chunk " << i;
  if (!scene->textures.contains(Sender::kStream))
    return testing::AssertionFailure() << "no texture";
  const double off =
      mean_difference(*scene->textures.at(Sender::kStream), Sender::picture(sequence));
  if (off > 12) return testing::AssertionFailure() << "picture of another capture: " << off;
  return testing::AssertionSuccess();
}

TEST(Receiver, PlaysInOrder) {
  Sender sender;
  Receiver receiver({});
  EXPECT_FALSE(receiver.scene());
  EXPECT_TRUE(receiver.missing().empty());
  for (int i = 0; i < 10; ++i) {
    if (i > 0) sender.change(i % 6);
    const Packet p = sender.next();
    EXPECT_TRUE(receiver.accept(p).empty());
    EXPECT_TRUE(receiver.missing().empty());
    EXPECT_TRUE(receiver.streams_waiting().empty());
    EXPECT_TRUE(equals(receiver.scene(), sender, p.sequence)) << i;
    EXPECT_EQ(receiver.scene()->captured_at, p.captured_at);
    EXPECT_EQ(receiver.scene()->views, p.views);
  }
}

TEST(Receiver, KeepsWhatDidNotChange) {
  Sender sender;
  Receiver receiver({});
  receiver.accept(sender.next());
  const auto before = receiver.scene();
  sender.change(2);
  receiver.accept(sender.next());
  const auto after = receiver.scene();
  ASSERT_TRUE(before && after);
  EXPECT_EQ(before->chunks[1], after->chunks[1]) << "the same object";
  EXPECT_NE(before->chunks[2], after->chunks[2]);
}

TEST(Receiver, ALostPacketIsMendedByAsking) {
  Sender sender;
  Receiver receiver({});
  receiver.accept(sender.next());
  sender.change(1);
  sender.change(3);
  static_cast<void>(sender.next());
  const Packet p = sender.next();
  EXPECT_TRUE(receiver.accept(p).empty());
  EXPECT_EQ(receiver.missing(), (std::vector<ChunkKey>{p.manifest[1], p.manifest[3]}));
  EXPECT_EQ(receiver.streams_waiting(), std::vector{Sender::kStream});
  EXPECT_FALSE(receiver.scene());
  for (const ChunkKey& key : receiver.missing()) {
    const auto chunk = sender.cache.find(key);
    ASSERT_TRUE(chunk);
    EXPECT_TRUE(receiver.provide(*chunk));
    EXPECT_TRUE(receiver.provide(*chunk)) << "twice does no harm";
  }
  EXPECT_TRUE(receiver.missing().empty());
  EXPECT_FALSE(receiver.scene()) << "the picture may build on a lost one";
  const Packet key = sender.next(true);
  EXPECT_TRUE(receiver.accept(key).empty());
  EXPECT_TRUE(equals(receiver.scene(), sender, key.sequence));
}

TEST(Receiver, AKeyFrameAfterAGapIsEnough) {
  Sender sender;
  Receiver receiver({});
  receiver.accept(sender.next());
  static_cast<void>(sender.next());
  const Packet p = sender.next(true);
  EXPECT_TRUE(receiver.accept(p).empty());
  EXPECT_TRUE(receiver.streams_waiting().empty());
  EXPECT_TRUE(equals(receiver.scene(), sender, p.sequence));
}

TEST(Receiver, LateJoiner) {
  Sender sender;
  for (int i = 0; i < 5; ++i) static_cast<void>(sender.next());
  Receiver receiver({});
  EXPECT_TRUE(receiver.accept(sender.next()).empty());
  EXPECT_EQ(receiver.missing().size(), 6u);
  EXPECT_EQ(receiver.streams_waiting(), std::vector{Sender::kStream});
  for (const ChunkKey& key : receiver.missing())
    EXPECT_TRUE(receiver.provide(*sender.cache.find(key)));
  const Packet p = sender.next(true);
  EXPECT_TRUE(receiver.accept(p).empty());
  EXPECT_TRUE(equals(receiver.scene(), sender, p.sequence));
}

TEST(Receiver, OldPacketsAreRefused) {
  Sender sender;
  Receiver receiver({});
  const Packet first = sender.next(), second = sender.next();
  receiver.accept(first);
  receiver.accept(second);
  for (const Packet& old : {first, second}) {
    const auto errors = receiver.accept(old);
    ASSERT_EQ(errors.size(), 1u);
    EXPECT_EQ(errors[0].cause, Error::Cause::invalid);
  }
  EXPECT_TRUE(equals(receiver.scene(), sender, second.sequence)) << "nothing happened";
}

TEST(Receiver, ANewEpochStartsAfresh) {
  Sender old_sender(6, 1), new_sender(3, 2);
  Receiver receiver({});
  for (int i = 0; i < 5; ++i) receiver.accept(old_sender.next());
  const Packet p = new_sender.next();  // an older sequence number
  EXPECT_TRUE(receiver.accept(p).empty());
  EXPECT_TRUE(equals(receiver.scene(), new_sender, p.sequence));
  Packet other = new_sender.next();
  other.node = "somebody else";
  EXPECT_TRUE(receiver.accept(other).empty());
  EXPECT_EQ(receiver.missing().size(), 3u);
}

TEST(Receiver, ABrokenChunkHarmsNoOther) {
  Sender sender;
  Receiver receiver({});
  Packet p = sender.next();
  test::edit(p.chunks[2].payload, [](auto& bytes) {
    bytes[20] ^= std::byte{0x55};
    bytes.resize(bytes.size() / 2);
  });
  p.chunks[4].triangles += 1;
  const auto errors = receiver.accept(p);
  EXPECT_EQ(errors.size(), 2u);
  EXPECT_EQ(receiver.missing(), (std::vector<ChunkKey>{p.manifest[2], p.manifest[4]}));
  EXPECT_FALSE(receiver.provide(p.chunks[2]));
  for (const ChunkKey& key : receiver.missing())
    EXPECT_TRUE(receiver.provide(*sender.cache.find(key)));
  EXPECT_TRUE(equals(receiver.scene(), sender, p.sequence));
}

TEST(Receiver, WhatNobodyAskedForIsRefused) {
  Sender sender;
  Receiver receiver({});
  EncodedChunk stray = *sender.cache.find(sender.next().manifest[0]);
  EXPECT_FALSE(receiver.provide(stray)) << "before the first packet";
  receiver.accept(sender.next());
  stray.key.version += 1000;
  EXPECT_FALSE(receiver.provide(stray));
}

TEST(Receiver, ABrokenPictureWaitsForAKeyFrame) {
  Sender sender;
  Receiver receiver({});
  receiver.accept(sender.next());
  Packet broken = sender.next();
  test::edit(broken.textures[0].data, [](auto& bytes) { bytes.resize(bytes.size() / 2); });
  EXPECT_EQ(receiver.accept(broken).size(), 1u);
  EXPECT_EQ(receiver.streams_waiting(), std::vector{Sender::kStream});
  EXPECT_TRUE(receiver.accept(sender.next()).empty()) << "waiting is no new error";
  EXPECT_FALSE(receiver.scene());
  const Packet p = sender.next(true);
  EXPECT_TRUE(receiver.accept(p).empty());
  EXPECT_TRUE(equals(receiver.scene(), sender, p.sequence));
}

TEST(Receiver, ALayoutChangesWithAKeyFrameOnly) {
  Sender sender;
  Receiver receiver({});
  receiver.accept(sender.next());
  sender.new_layout();
  EXPECT_EQ(receiver.accept(sender.next()).size(), 1u);
  EXPECT_FALSE(receiver.scene());
  const Packet p = sender.next(true);
  EXPECT_TRUE(receiver.accept(p).empty());
  EXPECT_TRUE(equals(receiver.scene(), sender, p.sequence));
  Packet stale = sender.next();
  stale.views[0].layout += 1;  // the view expects a picture that did not come
  receiver.accept(stale);
  EXPECT_FALSE(receiver.scene());
  EXPECT_EQ(receiver.streams_waiting(), std::vector{Sender::kStream});
}

TEST(Receiver, APictureOfAnotherSizeIsRefused) {
  Sender sender;
  Receiver receiver({});
  Packet p = sender.next();
  p.textures[0].width *= 2;
  EXPECT_EQ(receiver.accept(p).size(), 1u);
  EXPECT_FALSE(receiver.scene());
}

/// A fifth of the packets is lost; the receiver requests what it lacks, and in the end its mesh
/// equals the sender's.
TEST(Receiver, TwentyPercentLoss) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    std::mt19937 random(seed);
    Sender sender(8);
    Receiver receiver({});
    bool key_wanted = false;
    std::uint64_t shown = 0;
    int whole = 0, longest_gap = 0, gap = 0;
    for (int frame = 0; frame < 120; ++frame) {
      sender.change(static_cast<int>(random() % 8));
      const Packet sent = sender.next(key_wanted && frame % 5 == 0);
      if (sent.textures[0].key_frame) key_wanted = false;
      if (frame != 119 && random() % 5 == 0) {
        longest_gap = std::max(longest_gap, ++gap);
        continue;
      }
      const auto arrived = decode_packet(encode_packet(sent));
      ASSERT_TRUE(arrived) << arrived.error().message;
      EXPECT_TRUE(receiver.accept(*arrived).empty());
      for (const ChunkKey& key : receiver.missing())
        EXPECT_TRUE(receiver.provide(*sender.cache.find(key)));
      key_wanted = key_wanted || !receiver.streams_waiting().empty();
      if (const auto scene = receiver.scene()) {
        ASSERT_TRUE(equals(scene, sender, sent.sequence)) << "frame " << frame;
        shown = sent.sequence, ++whole, gap = 0;
      } else {
        longest_gap = std::max(longest_gap, ++gap);
      }
    }
    const Packet last = sender.next(true);
    EXPECT_TRUE(receiver.accept(last).empty());
    for (const ChunkKey& key : receiver.missing())
      EXPECT_TRUE(receiver.provide(*sender.cache.find(key)));
    EXPECT_TRUE(equals(receiver.scene(), sender, last.sequence));
    EXPECT_GT(whole, 30) << "seed " << seed;
    EXPECT_GT(shown, 150u);
    EXPECT_LE(longest_gap, 24) << "frames without a whole scene";
  }
}

// ---- the cache that answers ----

EncodedChunk chunk_of_version(std::uint32_t version) {
  return {{{}, 0, version}, 0, 1, {}, {}, {}};
}

TEST(ChunkCache, ForgetsWhatManifestsNoLongerName) {
  ChunkCache cache;
  cache.put(chunk_of_version(1));
  cache.put(chunk_of_version(2));
  const std::vector<ChunkKey> manifest = {{{}, 0, 2}};
  for (std::uint64_t i = 0; i + 1 < ChunkCache::kManifestsKept; ++i) cache.keep(manifest);
  EXPECT_TRUE(cache.find({{}, 0, 1}));
  cache.keep(manifest);
  EXPECT_FALSE(cache.find({{}, 0, 1}));
  EXPECT_TRUE(cache.find({{}, 0, 2}));
  EXPECT_EQ(cache.size(), 1u);
}

TEST(ChunkCache, NamedAgainInTimeIsKept) {
  ChunkCache cache;
  cache.put(chunk_of_version(1));
  const std::vector<ChunkKey> with = {{{}, 0, 1}};
  for (int round = 0; round < 4; ++round) {
    for (std::uint64_t i = 0; i + 1 < ChunkCache::kManifestsKept; ++i) cache.keep({});
    cache.keep(with);
  }
  EXPECT_TRUE(cache.find({{}, 0, 1}));
  EXPECT_FALSE(cache.find({{}, 1, 1}));
}

}  // namespace
}  // namespace mr::codec
