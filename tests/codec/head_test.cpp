#include "mr/codec/head.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <random>

#include "mr/codec/coalesce.h"
#include "mr/core/file.h"
#include "support/seal.h"

namespace mr::codec {
namespace {

Packet still_room(int sensors, int chunks) {
  Packet p;
  p.scene = "living room", p.node = "root", p.epoch = 7;
  for (int i = 0; i < sensors; ++i) {
    SourceInfo& source = p.sources.emplace_back();
    source.sensor = SensorId{static_cast<std::uint32_t>(i)};
    source.depth_camera.width = 640, source.depth_camera.height = 576;
    source.depth_camera.fx = source.depth_camera.fy = 500;
    source.depth_camera.cx = 320, source.depth_camera.cy = 288;
    View& view = p.views.emplace_back();
    view.id = view_of(source.sensor);
    view.width = 1280, view.height = 720;
    view.fx = view.fy = 600, view.cx = 640, view.cy = 360;
    view.image_rect = {0, 0, 1280, 720};
    view.atlas_rect = {0, 720 * i, 1280, 720};
  }
  for (int i = 0; i < chunks; ++i) p.manifest.push_back({{{i, 0, 0}}, 0, 1});
  for (const char* stage :
       {"sensors/coded", "sensors/reconstructed", "root/gathered", "root/merged"})
    p.marks.push_back({stage, {}});
  return p;
}

/// The packet of a later capture in which nothing else changed.
void advance(Packet& p) {
  ++p.sequence;
  p.captured_at = TimePoint(std::chrono::milliseconds(33) * static_cast<int>(p.sequence));
  Duration later(1'000'000);
  for (SourceInfo& source : p.sources) source.captured_at = p.captured_at - (later *= 2);
  for (TimeMark& mark : p.marks) mark.at = p.captured_at + (later *= 2);
}

TextureUnit unit(std::uint32_t stream, std::uint32_t serial, bool key_frame = false) {
  return {StreamId{stream}, serial, TextureCodec::h264, 0, 8192, 8192, key_frame, {std::byte{1}}};
}

EncodedChunk payload(const ChunkKey& key) {
  return {key, 0, 1, {}, {}, std::vector<std::byte>(8, static_cast<std::byte>(key.version))};
}

/// What a reader should have of what was written.
Packet as_written(Packet packet, const Packet& read) {
  packet.streams = read.streams;
  packet.coalesced = read.coalesced;
  return packet;
}

TEST(Head, APacketInWhichNothingChangedIsSmall) {
  HeadWriter writer;
  HeadReader reader;
  Packet p = still_room(4, 70);
  std::size_t whole = 0, same = 0;
  for (int i = 0; i < 20; ++i) {
    advance(p);
    const auto bytes = writer.write(p);
    (i < HeadWriter::kBroughtBy ? whole : same) = bytes.size();
    const auto back = reader.read(bytes);
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(*back, p) << i;
  }
  std::printf("4 sensors, 70 chunks: %zu bytes, %zu where nothing changed\n", whole, same);
  EXPECT_LE(same, 150u);
  EXPECT_GT(whole, 3000u);
}

TEST(Head, IsWholeFirstEveryThirtyAndOnRequest) {
  HeadWriter writer;
  Packet p = still_room(2, 5);
  std::vector<int> brought;
  for (int i = 0; i < 100; ++i) {
    if (i == 75) writer.ask_whole();
    advance(p);
    if (i == 50) p.manifest.pop_back();
    if (decode_message(writer.write(p))->base) brought.push_back(i);
  }
  // 32 brings the old base again, as nothing changed; 62 another one, three times.
  EXPECT_EQ(brought, (std::vector<int>{0, 1, 2, 32, 62, 63, 64, 75, 76, 77}));
}

TEST(Head, ANewEpochOrNodeIsWhole) {
  HeadWriter writer;
  Packet p = still_room(1, 3);
  for (int i = 0; i < 5; ++i) advance(p), writer.write(p);
  ++p.epoch, p.sequence = 0;
  const auto bytes = writer.write(p);
  ASSERT_TRUE(decode_packet(bytes));
  EXPECT_EQ(decode_packet(bytes)->epoch, p.epoch);
}

TEST(Head, EveryFieldMayChange) {
  HeadWriter writer;
  HeadReader reader;
  Packet p = still_room(3, 5);
  const auto arrives = [&] {
    advance(p);
    const auto back = reader.read(writer.write(p));
    EXPECT_TRUE(back) << back.error().message;
    if (!back) return;
    EXPECT_EQ(*back, as_written(p, *back));
  };
  for (int i = 0; i < HeadWriter::kBroughtBy; ++i) arrives();
  p.sources[1].confirmed_depth = {64, 10, 9, std::vector<std::uint8_t>(90, 1)};
  arrives();
  p.sources[1].confirmed_color = {256, 5, 3, std::vector<std::uint8_t>(15, 1)};
  arrives();
  p.sources[1].blind_color = {16, 80, 45, std::vector<std::uint8_t>(3600, 1)};
  arrives();
  p.sources[1].confirmed_depth.tiles[7] = 0;
  arrives();
  p.sources[1].confirmed_depth = {}, p.sources[1].blind_color.tiles[9] = 0;
  arrives();
  p.sources[0].T_world_depth.translation.x = 1;
  arrives();
  p.sources.erase(p.sources.begin());
  p.views.erase(p.views.begin());
  arrives();
  p.views.push_back(p.views.back());
  p.views.back().layer = Layer::still, p.views.back().gain = {1, 2, 0.5f};
  p.views.back().stream = StreamId{1};
  arrives();
  p.views.back().image_rect.x = 64, p.views.back().image_rect.width -= 64;
  arrives();
  p.manifest.insert(p.manifest.begin(), ChunkKey{{{-1, 0, 0}}, 0, 1});
  p.manifest[3].version = 2;
  p.chunks = {payload(p.manifest[0]), payload(p.manifest[3])};
  arrives();
  p.chunks.clear();
  p.plan.texture_qp = 30;
  arrives();
  p.marks.pop_back();
  arrives();
  p.marks.clear();
  arrives();
  p.captured_at += std::chrono::hours(1);
  for (int i = 0; i < 3; ++i) advance(p);
  p.sources[0].captured_at = TimePoint(std::chrono::hours(24));
  p.manifest.clear();
  const auto back = reader.read(writer.write(p));
  ASSERT_TRUE(back);
  EXPECT_EQ(*back, as_written(p, *back));
}

TEST(Head, StreamsAreThoseOfTheUnits) {
  HeadWriter writer;
  HeadReader reader;
  Packet p = still_room(2, 1);
  p.views[1].stream = StreamId{1};
  const auto streams = [&](std::vector<TextureUnit> units) {
    p.textures = std::move(units);
    advance(p);
    const auto back = reader.read(writer.write(p));
    return back ? back->streams : std::vector<StreamState>{};
  };
  const auto states = [](auto... serials) {
    std::vector<StreamState> out;
    (out.push_back(
         {StreamId{static_cast<std::uint32_t>(out.size())}, static_cast<std::uint32_t>(serials)}),
     ...);
    return out;
  };
  EXPECT_EQ(streams({unit(0, 3), unit(1, 0)}), states(3, 0));
  EXPECT_EQ(streams({unit(0, 4)}), states(4, 0));
  for (std::uint32_t i = 5; i < 50; ++i) EXPECT_EQ(streams({unit(0, i)}), states(i, 0));
  EXPECT_EQ(streams({}), states(49, 0));
  p.views.pop_back();
  EXPECT_EQ(streams({}), states(49));
}

TEST(Head, WhoMissedTheBaseKnows) {
  HeadWriter writer;
  HeadReader reader;
  Packet p = still_room(1, 3);
  for (int i = 0; i < 10; ++i) advance(p), writer.write(p);
  advance(p);
  const auto refused = reader.read(writer.write(p));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().cause, Error::Cause::not_found);
  EXPECT_TRUE(reader.lacks_base());
  writer.ask_whole();
  advance(p);
  EXPECT_TRUE(reader.read(writer.write(p)));
  EXPECT_FALSE(reader.lacks_base());
}

TEST(Head, ADifferenceAloneIsNoPacket) {
  HeadWriter writer;
  Packet p = still_room(1, 3);
  std::vector<std::byte> bytes;
  for (int i = 0; i < 5; ++i) advance(p), bytes = writer.write(p);
  const auto refused = decode_packet(bytes);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().cause, Error::Cause::not_found);
}

TEST(Head, WhatDoesNotFitItsBaseIsRefused) {
  Packet base = *base_of(still_room(2, 3));
  const auto fits = [&](const std::function<void(PacketMessage&)>& change) {
    PacketMessage message;
    message.sequence = message.age = 1;
    message.source_times.resize(2), message.mark_times.resize(4);
    change(message);
    const auto decoded = decode_message(encode_message(message));
    return decoded && complete(*decoded, base);
  };
  EXPECT_TRUE(fits([](PacketMessage&) {}));
  EXPECT_FALSE(fits([](PacketMessage& m) { m.source_times.resize(1); }));
  EXPECT_FALSE(fits([](PacketMessage& m) { m.source_times.resize(3); }));
  EXPECT_FALSE(fits([](PacketMessage& m) { m.mark_times.clear(); }));
  EXPECT_FALSE(fits([](PacketMessage& m) { m.change.removed = {{{{9, 0, 0}}, 0, 1}}; }));
  EXPECT_TRUE(fits([](PacketMessage& m) { m.change.removed = {{{{1, 0, 0}}, 0, 1}}; }));
  EXPECT_FALSE(fits([](PacketMessage& m) { m.change.added = {{{{1, 0, 0}}, 0, 1}}; }));
  EXPECT_FALSE(fits([](PacketMessage& m) { m.change.removed_sources = {SensorId{5}}; }));
  EXPECT_FALSE(fits([](PacketMessage& m) {
    m.change.removed_views = {{ViewId{5}, Layer::moving}};
  }));
  EXPECT_FALSE(fits([](PacketMessage& m) {
    m.change.removed_views = {{ViewId{0}, Layer::still}};
  }));
  EXPECT_TRUE(fits([](PacketMessage& m) {
    m.change.removed_views = {{ViewId{0}, Layer::moving}};
  }));
  EXPECT_FALSE(fits([](PacketMessage& m) {
    m.change.confirmed = {{SensorId{5}, TileMask{64, 10, 9, std::vector<std::uint8_t>(90)}, {}}};
  }));
  EXPECT_FALSE(fits([](PacketMessage& m) {
    m.change.confirmed = {{SensorId{0}, TileMask{64, 9, 9, std::vector<std::uint8_t>(81)}, {}}};
  }));
  EXPECT_TRUE(fits([](PacketMessage& m) {
    m.change.confirmed = {{SensorId{0}, TileMask{64, 10, 9, std::vector<std::uint8_t>(90)}, {}}};
  }));
  EXPECT_FALSE(fits([](PacketMessage& m) { m.chunks = {payload({{{9, 0, 0}}, 0, 1})}; }));
  EXPECT_FALSE(fits([](PacketMessage& m) {
    m.textures = {unit(0, 1, true)};
    m.textures[0].width = 1024;
  })) << "a view's tile outside its texture";
}

/// What a node sends after its start: the base thrice, times only, then some of everything.
std::vector<std::vector<std::byte>> golden_packets() {
  HeadWriter writer;
  std::vector<std::vector<std::byte>> out;
  Packet p = still_room(2, 3);
  p.textures = {unit(0, 1, true)};
  const auto write = [&] {
    advance(p);
    out.push_back(writer.write(p));
    p.textures.clear();
  };
  for (int i = 0; i < 4; ++i) write();
  p.manifest = {
      {{{0, 0, 0}}, 0, 1}, {{{1, 0, 0}, kMergedSource, Layer::still}, 2, 9}, {{{2, 0, 0}}, 0, 1}};
  p.chunks = {payload(p.manifest[1])};
  p.views.push_back(p.views[1]);
  p.views[2].layer = Layer::still, p.views[2].gain = {0.5f, 1, 2}, p.views[2].stream = StreamId{1};
  p.sources[0].confirmed_depth = {64, 10, 9, std::vector<std::uint8_t>(90, 1)};
  p.sources[1].precision.base_m = 0.005;
  p.textures = {unit(0, 2), unit(1, 0, true)};
  p.plan.texture_qp = 31;
  p.marks.pop_back();
  write();
  return out;
}

TEST(Head, GoldenBytesOfVersionFour) {
  const auto file = std::filesystem::path(MR_SOURCE_DIR) / "tests/data/packets_v4.bin";
  std::vector<std::byte> all;  // each after its length, 32 bits
  for (const auto& bytes : golden_packets()) {
    const auto size = static_cast<std::uint32_t>(bytes.size());
    for (int i = 0; i < 4; ++i) all.push_back(static_cast<std::byte>(size >> (8 * i) & 0xFF));
    all.insert(all.end(), bytes.begin(), bytes.end());
  }
  if (std::getenv("MR_UPDATE_GOLDEN") != nullptr) {
    ASSERT_TRUE(write_file(file, all));
  }
  const auto golden = read_file(file);
  ASSERT_TRUE(golden) << golden.error().message;
  EXPECT_EQ(all, *golden) << "a change of format; see docs/wire-format.md";
}

/// A scene in which chunks, views and masks come, change and go.
class RandomScene {
 public:
  explicit RandomScene(unsigned seed) : random_(seed), packet_(still_room(4, 30)) {
    for (const ChunkKey& key : packet_.manifest) packet_.chunks.push_back(payload(key));
    packet_.textures = {unit(0, serial_, true)};
  }

  void step(bool changes) {
    advance(packet_);
    if (packet_.sequence > 1) packet_.chunks.clear(), packet_.textures.clear();
    if (!changes || packet_.sequence == 1) return;
    if (any(2)) packet_.textures.push_back(unit(0, ++serial_));
    for (ChunkKey& key : packet_.manifest)
      if (any(10)) key.version = ++version_, packet_.chunks.push_back(payload(key));
    if (any(8)) change_list();
    if (any(20)) packet_.views[1 + random_() % 3].gain.x = any(2) ? 1.0f : 1.5f;
    if (any(20)) packet_.plan.texture_qp = static_cast<int>(random_() % 50);
    if (any(3)) packet_.sources[random_() % packet_.sources.size()].confirmed_depth = mask();
    if (any(30)) packet_.sources.size() > 2 ? packet_.sources.pop_back() : void(add_source());
    if (any(30))
      packet_.marks.size() > 2 ? packet_.marks.pop_back() : packet_.marks.push_back({"x", {}});
    for (TimeMark& mark : packet_.marks) mark.at = packet_.captured_at;
    for (SourceInfo& source : packet_.sources) source.captured_at = packet_.captured_at;
  }
  const Packet& packet() const { return packet_; }

 private:
  bool any(unsigned of) { return random_() % of == 0; }
  void change_list() {
    std::vector<ChunkKey>& keys = packet_.manifest;
    if (keys.size() > 20) {
      const ChunkKey gone = keys[random_() % keys.size()];
      std::erase(keys, gone);
      std::erase_if(packet_.chunks, [&](const EncodedChunk& chunk) { return chunk.key == gone; });
    } else {
      keys.push_back(
          {{{static_cast<int>(100 + packet_.sequence), 0, 0}, kMergedSource, Layer::still},
           0,
           ++version_});
      packet_.chunks.push_back(payload(keys.back()));
    }
  }
  TileMask mask() {
    if (any(4)) return {};
    TileMask out{64, 10, 9, std::vector<std::uint8_t>(90)};
    for (std::uint8_t& tile : out.tiles) tile = any(2);
    return out;
  }
  void add_source() {
    packet_.sources.push_back(packet_.sources.back());
    SensorId& sensor = packet_.sources.back().sensor;
    sensor = SensorId{number_of(sensor) + 1};
  }

  std::mt19937 random_;
  Packet packet_;
  std::uint32_t version_ = 1, serial_ = 0;
};

/// Everything but the payloads.
Packet head_of(const Packet& packet) {
  Packet out = packet;
  out.chunks.clear(), out.textures.clear(), out.streams.clear();
  out.coalesced = 0;
  return out;
}

/// What a receiver has of a node: packets, the chunks in them, and an ask for what is missing that
/// takes a packet's time.
class Client {
 public:
  void take(const std::vector<std::byte>& bytes) {
    auto packet = reader.read(bytes);
    if (!packet) {
      EXPECT_EQ(packet.error().cause, Error::Cause::not_found) << packet.error().message;
      ++dropped;
      return;
    }
    for (const EncodedChunk& chunk : packet->chunks) chunks[chunk.key] = chunk.payload;
    newest = *std::move(packet);
  }
  bool wants_whole(std::uint64_t now) {
    if (!reader.lacks_base() || (asked && now - *asked < 15)) return false;  // twice a second
    asked = now;
    return true;
  }

  HeadReader reader;
  std::optional<Packet> newest;
  std::map<ChunkKey, SharedBytes> chunks;
  std::optional<std::uint64_t> asked;
  int dropped = 0;
};

/// A fifth of the packets is lost, others wait and are folded; 15 packets (500 ms at 30 a second)
/// after the sender came to rest, the receiver has its head.
TEST(Head, EqualsTheSendersWithin15PacketsOfAnyLossAndFold) {
  int rests = 0, dropped = 0, folded = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    RandomScene scene(seed);
    HeadWriter writer;
    Client client;
    std::vector<PacketMessage> waiting;
    for (int n = 0; n < 600; ++n) {
      scene.step(n % 60 < 45);
      const auto bytes = writer.write(scene.packet());
      if (random() % 5 != 0) waiting.push_back(*decode_message(bytes));
      if (random() % 3 != 0 && !waiting.empty()) {
        folded += static_cast<int>(waiting.size()) - 1;
        client.take(encode_message(coalesce(waiting)));
        waiting.clear();
      }
      if (client.newest && client.newest->sequence == scene.packet().sequence) {
        EXPECT_EQ(head_of(*client.newest), head_of(scene.packet()));
      }
      if (client.wants_whole(static_cast<std::uint64_t>(n))) writer.ask_whole();
      if (n % 60 != 59) continue;
      ++rests;
      ASSERT_TRUE(client.newest) << "seed " << seed;
      EXPECT_EQ(client.newest->manifest, scene.packet().manifest) << "seed " << seed << " at " << n;
      EXPECT_EQ(client.newest->views, scene.packet().views);
      ASSERT_EQ(client.newest->sources.size(), scene.packet().sources.size());
      for (std::size_t i = 0; i < client.newest->sources.size(); ++i)
        EXPECT_EQ(client.newest->sources[i].confirmed_depth,
                  scene.packet().sources[i].confirmed_depth);
    }
    dropped += client.dropped;
  }
  EXPECT_EQ(rests, 200);
  EXPECT_GT(folded, 1000);
  std::printf("%d packets could not be read, of 12000 with 20 %% lost\n", dropped);
}

/// Without loss, any folding gives every head, payload and unit.
TEST(Head, FoldsLoseNothing) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    std::mt19937 random(seed);
    RandomScene scene(seed + 50);
    HeadWriter writer;
    Client client;
    std::vector<PacketMessage> waiting;
    std::uint32_t serial = 0;
    for (int n = 0; n < 300; ++n) {
      scene.step(true);
      waiting.push_back(*decode_message(writer.write(scene.packet())));
      if (random() % 6 == 0 && waiting.size() > 2) {  // some are folded on the way
        const PacketMessage one = coalesce(waiting);
        waiting = {*decode_message(encode_message(one))};
      }
      if (random() % 4 != 0) continue;
      client.take(encode_message(coalesce(waiting)));
      waiting.clear();
      ASSERT_TRUE(client.newest);
      EXPECT_EQ(head_of(*client.newest), head_of(scene.packet()));
      for (const ChunkKey& key : client.newest->manifest)
        EXPECT_TRUE(client.chunks.contains(key)) << n;
      for (const TextureUnit& u : client.newest->textures) {
        EXPECT_TRUE(u.serial == serial + 1 || u.key_frame);
        serial = u.serial;
      }
      ASSERT_EQ(client.newest->streams.size(), 1u);
      EXPECT_EQ(client.newest->streams[0].serial, serial);
    }
    EXPECT_EQ(client.dropped, 0);
  }
}

TEST(Head, CorruptionNeverCrashes) {
  RandomScene scene(3);
  HeadWriter writer;
  std::vector<std::vector<std::byte>> good;
  for (int i = 0; i < 40; ++i) {
    scene.step(true);
    good.push_back(writer.write(scene.packet()));
  }
  std::mt19937 random(9);
  int accepted = 0;
  for (int round = 0; round < 300; ++round) {
    HeadReader reader;
    for (auto bytes : good) {
      for (int flips = static_cast<int>(random() % 3); flips > 0; --flips)
        bytes[random() % bytes.size()] = static_cast<std::byte>(random());
      const auto packet = reader.read(test::resealed(bytes));
      if (!packet) continue;
      ++accepted;
      EXPECT_TRUE(std::is_sorted(packet->manifest.begin(), packet->manifest.end()));
      EXPECT_TRUE(decode_packet(encode_packet(*packet)));
    }
  }
  EXPECT_GT(accepted, 1000);
}

}  // namespace
}  // namespace mr::codec
