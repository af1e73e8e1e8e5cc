#include "mr/codec/packet_codec.h"
#include "mr/codec/packet_message.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <random>

#include "mr/codec/head.h"
#include "mr/codec/mesh_codec.h"
#include "mr/core/file.h"
#include "packet_generated.h"
#include "support/meshes.h"
#include "support/seal.h"

namespace mr::codec {
namespace {

std::vector<std::byte> counting(std::size_t n) {
  std::vector<std::byte> out(n);
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<std::byte>(i * 37);
  return out;
}

Camera pinhole(int width, int height) {
  Camera c;
  c.width = width, c.height = height;
  c.fx = 500.5, c.fy = 501.25, c.cx = width / 2.0, c.cy = height / 2.0;
  return c;
}

SourceInfo source(std::uint32_t sensor) {
  SourceInfo s;
  s.sensor = SensorId{sensor};
  s.captured_at = TimePoint(Duration(1'700'000'000'000'000'000 + sensor));
  s.depth_camera = pinhole(640, 576);
  s.T_world_depth = look_at({1, 2, 1.5}, {0.25, 0.5, 1}, {0, 0, 1});
  s.precision = {0.002, 0.0003};
  return s;
}

TileMask mask(int width, int height, int tile_px) {
  TileMask m{tile_px, (width + tile_px - 1) / tile_px, (height + tile_px - 1) / tile_px, {}};
  for (int i = 0; i < m.columns * m.rows; ++i) m.tiles.push_back(i % 3 == 0);
  return m;
}

View view(ViewId id) {
  View v;
  v.id = id;
  v.width = 1280, v.height = 720;
  v.fx = 600, v.fy = 601, v.cx = 640, v.cy = 360.5;
  v.T_world_camera = look_at({1, 2, 1.5}, {0.25, 0.5, 1}, {0, 0, 1});
  v.image_rect = {10, 20, 1200, 700};
  v.atlas_rect = {16, 32, 600, 350};
  v.gutter_px = 2.5f;
  v.layout = 3;
  return v;
}

/// Every field holds something else than its default.
Packet full_packet() {
  Packet p;
  p.scene = "living room", p.node = "merge/root";
  p.epoch = 2, p.sequence = 1'234'567'890'123;
  p.captured_at = TimePoint(Duration(1'700'000'000'123'456'789));
  p.sources = {source(0), source(2), source(5)};
  Camera& lidar = p.sources[1].depth_camera;
  lidar = {};
  lidar.model = CameraModel::lidar;
  lidar.width = 1024, lidar.height = 4;
  lidar.beam_altitude_rad = {0.3, 0.1, -0.1, -0.3};
  lidar.beam_azimuth_rad = {0.01, -0.01, 0.02, 0};
  p.sources[2].depth_camera.model = CameraModel::equirectangular;
  p.plan = {{0.5, 0}, 0, 7, 0.75, 33};
  p.views = {view(ViewId{0}), view(ViewId{5})};
  p.views[1].kind = View::Kind::equirectangular;
  p.views[1].stream = StreamId{9};
  p.views.push_back(p.views[1]);
  p.views[2].layer = Layer::still, p.views[2].gain = {0.5f, 1.25f, 2},
  p.views[2].stream = StreamId{10};
  p.sources[0].confirmed_depth = mask(640, 576, 8);
  p.sources[0].confirmed_color = mask(1280, 720, 16);
  p.manifest = {{{{-1, 2, 3}, kMergedSource}, 0, 7},
                {{{0, 0, 0}, SensorId{1}}, 0, 8},
                {{{0, 0, 0}, SensorId{1}}, 2, 1},
                {{{0, 0, 0}, SensorId{1}, Layer::still}, 0, 1}};
  const Mesh wall = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 3, 3);
  Chunk chunk{p.manifest[0], 0.003f, *snap_to_lattice(wall, {})};
  chunk.mesh.views = {{0, 10, ViewId{0}}, {10, 8, ViewId{5}}};
  p.chunks = {*encode_chunk(chunk, {}, 5)};
  p.chunks.push_back({p.manifest[2], 0, 12, {}, {}, counting(45)});
  p.textures = {{StreamId{0}, 70'000, TextureCodec::h264, 3, 640, 400, true, counting(77)},
                {StreamId{1}, 2, TextureCodec::h264, 4, 8192, 8192, false, counting(5)}};
  p.streams = {{StreamId{0}, 70'000}, {StreamId{1}, 2}, {StreamId{9}, 5}, {StreamId{10}, 1}};
  p.marks = {{"cam0/fuse", TimePoint(Duration(5))}, {"cam0/encode_mesh", TimePoint(Duration(6))}};
  return p;
}

/// Whether the packet is refused after a change, with this cause.
testing::AssertionResult refused(Error::Cause cause, const std::function<void(Packet&)>& change) {
  Packet packet = full_packet();
  change(packet);
  const auto out = decode_packet(encode_packet(packet));
  if (out) return testing::AssertionFailure() << "accepted";
  if (out.error().cause != cause)
    return testing::AssertionFailure()
           << cause_name(out.error().cause) << ": " << out.error().message;
  return testing::AssertionSuccess() << out.error().message;
}
testing::AssertionResult invalid(const std::function<void(Packet&)>& change) {
  return refused(Error::Cause::invalid, change);
}

TEST(PacketCodec, RoundTrip) {
  const Packet packet = full_packet();
  const auto bytes = encode_packet(packet);
  const auto back = decode_packet(bytes);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, packet);
  EXPECT_EQ(encode_packet(packet), bytes) << "the same packet is the same bytes";
  EXPECT_EQ(encode_packet(*back), bytes);
}

TEST(PacketCodec, APlanTellsItsErrorLimits) {
  Packet packet = full_packet();
  packet.plan.decimation = {0, 0.25}, packet.plan.still_error_m = 0.125;
  packet.plan.plate_scale = 0.5, packet.plan.plate_qp = 24;
  const auto back = decode_packet(encode_packet(packet));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->plan, packet.plan);
}

TEST(PacketCodec, AnEmptyPacketIsAPacket) {
  const auto back = decode_packet(encode_packet({}));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, Packet{});
}

TEST(PacketCodec, GoldenBytesOfVersionFour) {
  const auto file = std::filesystem::path(MR_SOURCE_DIR) / "tests/data/packet_v4.bin";
  Packet packet = full_packet();
  packet.chunks.erase(packet.chunks.begin());  // Draco's bytes are Draco's business
  // Nor may the last bit of a root decide.
  for (SourceInfo& s : packet.sources) s.T_world_depth = {{{0, 0, 1, 1, 0, 0, 0, 1, 0}}, {1, 2, 3}};
  for (View& v : packet.views) v.T_world_camera = packet.sources[0].T_world_depth;
  if (std::getenv("MR_UPDATE_GOLDEN") != nullptr) {
    ASSERT_TRUE(write_file(file, encode_packet(packet)));
  }
  const auto golden = read_file(file);
  ASSERT_TRUE(golden) << golden.error().message;
  const auto back = decode_packet(*golden);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, packet) << "old bytes must stay readable";
  EXPECT_EQ(encode_packet(packet), *golden) << "a change of format; see docs/wire-format.md";
}

TEST(PacketCodec, AnyAlignmentReads) {
  const Packet packet = full_packet();
  const auto bytes = encode_packet(packet);
  std::vector<std::byte> shifted(bytes.size() + 8);
  for (std::size_t offset = 0; offset < 8; ++offset) {
    std::memcpy(shifted.data() + offset, bytes.data(), bytes.size());
    const auto back = decode_packet(std::span(shifted).subspan(offset, bytes.size()));
    ASSERT_TRUE(back) << offset;
    EXPECT_EQ(*back, packet);
  }
}

TEST(PacketCodec, PayloadsLieOnEightBytes) {
  const auto bytes = encode_packet(full_packet());
  const auto* packet = wire::GetPacket(bytes.data());
  for (const auto* chunk : *packet->chunks())
    EXPECT_EQ((chunk->payload()->data() - reinterpret_cast<const std::uint8_t*>(bytes.data())) % 8,
              0);
  for (const auto* unit : *packet->textures())
    EXPECT_EQ((unit->data()->data() - reinterpret_cast<const std::uint8_t*>(bytes.data())) % 8, 0);
}

TEST(PacketCodec, EveryTruncationIsAnError) {
  const auto bytes = encode_packet(full_packet());
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_FALSE(decode_packet(std::span(bytes).first(n))) << n << " of " << bytes.size();
}

TEST(PacketCodec, EveryFlippedBitIsSeen) {
  auto bytes = encode_packet(full_packet());
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const std::byte mask{static_cast<unsigned char>(1u << bit % 8)};
    bytes[bit / 8] ^= mask;
    EXPECT_FALSE(decode_packet(bytes)) << "bit " << bit;
    bytes[bit / 8] ^= mask;
  }
  EXPECT_TRUE(decode_packet(bytes));
}

/// A buffer as no builder of ours writes it: numbers of eight bytes that do not lie on eight. Read
/// as they are they would be undefined behaviour, which the sanitizer stops at.
TEST(PacketCodec, NumbersOfEightBytesMayLieAnywhere) {
  flatbuffers::FlatBufferBuilder b;
  const auto odd = [&](const std::vector<double>& values) {
    std::vector<std::uint32_t> words(2 * values.size() + 1);
    std::memcpy(words.data(), values.data(), 8 * values.size());
    const auto vector = b.CreateVector(words);
    return vector.o;
  };
  for (const std::size_t pad : {0u, 1u}) {  // one of them lies off eight
    b.Clear();
    const std::vector<double> beams = {0.1, 0.2};
    const auto name = b.CreateString("n");
    if (pad > 0) b.CreateVector(std::vector<std::uint32_t>{1});
    auto at = odd(beams);
    // Its length is that of doubles.
    std::uint32_t two = 2;
    std::memcpy(b.GetCurrentBufferPointer(), &two, sizeof two);
    const auto vector = flatbuffers::Offset<flatbuffers::Vector<double>>(at);
    const auto camera =
        wire::CreateCamera(b, wire::CameraModel::lidar, 64, 2, 1, 1, 0, 0, vector, vector);
    const wire::Pose pose({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0});
    const auto source = wire::CreateSource(b, 0, camera, &pose, 0.001, 0);
    const auto sources = b.CreateVector(&source, 1);
    const auto head = wire::CreateHead(b, name, name, wire::CreatePlan(b), sources);
    const std::vector<std::int32_t> delays = {0};
    const auto delay = b.CreateVector(delays);
    wire::FinishPacketBuffer(b, wire::CreatePacket(b, 0, 0, 0, 0, delay, 0, 0, 0, 0, head));
    const auto out = decode_packet(test::sealed(b.GetBufferPointer(), b.GetSize()));
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->sources[0].depth_camera.beam_altitude_rad, beams);
  }
}

TEST(PacketCodec, OtherBytesAreRefused) {
  EXPECT_FALSE(decode_packet({}));
  auto bytes = encode_packet(full_packet());
  bytes[4] = std::byte{'X'};
  EXPECT_EQ(decode_packet(bytes).error().cause, Error::Cause::corrupt);
}

TEST(PacketCodec, CapsAreChecked) {
  const Packet packet = full_packet();
  const auto bytes = encode_packet(packet);
  const auto too_large = [&](const PacketLimits& limits) {
    const auto out = decode_packet(bytes, limits);
    return !out && out.error().cause == Error::Cause::too_large;
  };
  EXPECT_TRUE(too_large({.packet_bytes = bytes.size() - 1}));
  EXPECT_TRUE(decode_packet(bytes, {.packet_bytes = bytes.size()}));
  EXPECT_TRUE(too_large({.manifest_chunks = 3}));
  EXPECT_TRUE(too_large({.mask_tiles = 80 * 72 + 80 * 45 - 1}));
  EXPECT_TRUE(decode_packet(bytes, {.mask_tiles = 80 * 72 + 80 * 45}));
  EXPECT_TRUE(too_large({.views = 1}));
  EXPECT_TRUE(too_large({.marks = 1}));
  EXPECT_TRUE(too_large({.textures = 1}));
  EXPECT_TRUE(too_large({.texture_side = 8190}));
  EXPECT_TRUE(too_large({.chunk_triangles = 17}));
  EXPECT_TRUE(too_large({.packet_triangles = 29}));
  EXPECT_TRUE(too_large({.name_bytes = 15}));
  EXPECT_TRUE(refused(Error::Cause::too_large,
                      [](Packet& p) { p.chunks[0].views.assign(255, ViewId{0}); }));
}

TEST(PacketCodec, NamesArePrintableAscii) {
  const std::string names[] = {"tab\t", "line\n", "\xC3\xA4", "\x7F", std::string("nul\0nul", 7)};
  for (const std::string& name : names) {
    EXPECT_TRUE(invalid([&](Packet& p) { p.scene = name; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.node = name; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.marks[1].stage = name; }));
  }
}

TEST(PacketCodec, NumbersAreFiniteAndPossible) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (const double bad : {kNan, kInf, -kInf}) {
    const auto badf = static_cast<float>(bad);
    EXPECT_TRUE(invalid([&](Packet& p) { p.plan.decimation.ratio = badf; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.plan.texture_scale = badf; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.plan.plate_scale = badf; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.sources[0].precision.base_m = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.sources[0].precision.per_m2 = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.sources[0].depth_camera.fx = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.sources[0].T_world_depth.translation.z = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.sources[1].depth_camera.beam_altitude_rad[2] = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.sources[1].depth_camera.beam_azimuth_rad[3] = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.sources[2].depth_camera.cy = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.views[0].cx = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.views[1].fx = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.views[0].gutter_px = badf; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.views[0].gain.x = badf; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.views[2].gain.z = badf; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.views[0].T_world_camera.rotation(1, 2) = bad; }));
    EXPECT_TRUE(invalid([&](Packet& p) { p.chunks[0].error_m = badf; }));
  }
  EXPECT_TRUE(invalid([](Packet& p) { p.plan.decimation.ratio = 1.1f; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.plan.mesh_speed = 11; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.plan.texture_qp = -1; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.plan.plate_qp = 52; }));
  EXPECT_TRUE(
      invalid([](Packet& p) { p.captured_at = TimePoint(Duration(std::int64_t{1} << 62)); }));
  EXPECT_TRUE(invalid(
      [](Packet& p) { p.sources[0].captured_at = TimePoint(Duration(std::int64_t{1} << 62)); }));
  EXPECT_TRUE(
      invalid([](Packet& p) { p.marks[0].at = TimePoint(Duration(std::int64_t{1} << 62)); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.chunks[0].triangles = 0; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.chunks[0].payload = {}; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.textures[0].data = {}; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.textures[0].width = 641; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.textures[0].height = 0; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.textures[0].codec = static_cast<TextureCodec>(9); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.views[0].kind = static_cast<View::Kind>(2); }));
  EXPECT_TRUE(
      invalid([](Packet& p) { p.sources[0].depth_camera.model = static_cast<CameraModel>(3); }));
}

TEST(PacketCodec, GainsAreModerate) {
  for (const float bad : {0.0f, -1.0f, 0.0624f, 16.01f})
    EXPECT_TRUE(invalid([&](Packet& p) { p.views[1].gain.y = bad; })) << bad;
  for (const float good : {0.0625f, 16.0f})
    EXPECT_FALSE(invalid([&](Packet& p) { p.views[1].gain.y = good; })) << good;
}

TEST(PacketCodec, MasksFitTheirPictures) {
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[0].confirmed_depth = mask(648, 576, 8); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[0].confirmed_color = mask(1280, 704, 16); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[0].blind_color = mask(1280, 704, 16); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[0].confirmed_depth.tiles.resize(80 * 71); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[0].confirmed_depth.tiles.resize(80 * 72 + 8); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[0].confirmed_depth = mask(640, 576, 257); }));
  EXPECT_FALSE(invalid([](Packet& p) { p.sources[0].confirmed_depth = mask(640, 576, 256); }));
  EXPECT_FALSE(invalid([](Packet& p) { p.sources[0].confirmed_depth = mask(640, 576, 1); }));
  // A sensor without a view may say what it likes, of a picture that can be.
  EXPECT_FALSE(invalid([](Packet& p) { p.sources[1].confirmed_color = mask(8192, 8192, 16); }));
  EXPECT_TRUE(refused(Error::Cause::too_large,
                      [](Packet& p) { p.sources[1].confirmed_color = mask(8193, 16, 16); }));
}

TEST(PacketCodec, BlindTilesTravel) {
  Packet packet = full_packet();
  packet.sources[0].blind_color = mask(1280, 720, 16);
  const auto back = decode_packet(encode_packet(packet));
  ASSERT_TRUE(back);
  EXPECT_EQ(*back, packet);
}

TEST(PacketCodec, ABitBeyondAMasksLastTileIsRefused) {
  Packet packet = full_packet();
  packet.sources[0].confirmed_depth = mask(640, 576, 100);  // 7 x 6 tiles
  packet.sources[0].confirmed_depth.tiles.assign(42, 1);
  auto bytes = encode_packet(packet);
  const std::byte last[] = {std::byte{0xFF}, std::byte{0xFF}, std::byte{0xFF}, std::byte{0x03}};
  const auto at = std::search(bytes.begin(), bytes.end(), std::begin(last), std::end(last));
  ASSERT_NE(at, bytes.end());
  ASSERT_TRUE(decode_packet(bytes));
  at[3] = std::byte{0x07};
  EXPECT_EQ(decode_packet(test::resealed(bytes)).error().cause, Error::Cause::invalid);
}

TEST(PacketCodec, LayersAreKnown) {
  EXPECT_TRUE(invalid([](Packet& p) { p.views[2].layer = static_cast<Layer>(2); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.manifest[3].id.layer = static_cast<Layer>(2); }));
}

TEST(PacketCodec, PosesAreRigid) {
  EXPECT_TRUE(invalid([](Packet& p) { p.views[0].T_world_camera.rotation(0, 0) += 0.01; }));
  EXPECT_TRUE(invalid([](Packet& p) {
    p.sources[0].T_world_depth.rotation = {{0, 0, 0, 0, 0, 0, 0, 0, 0}};
  }));
  EXPECT_TRUE(invalid([](Packet& p) {
    p.sources[0].T_world_depth.rotation = {{1, 0, 0, 0, 1, 0, 0, 0, -1}};
  })) << "mirrored";
  EXPECT_TRUE(invalid([](Packet& p) { p.views[0].T_world_camera.translation.x = 1e9; }));
}

TEST(PacketCodec, CamerasAreUsable) {
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[0].depth_camera.fx = 0; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[0].depth_camera.width = -4; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[1].depth_camera.beam_azimuth_rad.pop_back(); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.views[0].width = 1 << 20; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.views[0].fy = -600; }));
}

TEST(PacketCodec, RectanglesLieInTheirPictures) {
  constexpr int kMax = std::numeric_limits<int>::max();
  for (const Rect bad : {Rect{},
                         Rect{-1, 0, 10, 10},
                         {0, -1, 10, 10},
                         {1271, 0, 10, 10},
                         {0, 711, 10, 10},
                         {0, 0, -5, 10},
                         {kMax, 0, 10, 10},
                         {1, 1, kMax, kMax}}) {
    EXPECT_TRUE(invalid([&](Packet& p) { p.views[0].image_rect = bad; })) << bad.x << " " << bad.y;
    EXPECT_TRUE(invalid([&](Packet& p) { p.views[0].atlas_rect = bad; })) << bad.x << " " << bad.y;
  }
  EXPECT_TRUE(invalid([](Packet& p) { p.views[0].atlas_rect.width = 625; })) << "16 + 625 > 640";
  EXPECT_FALSE(invalid([](Packet& p) { p.views[0].atlas_rect.width = 624; }));
  EXPECT_FALSE(invalid([](Packet& p) { p.views[1].atlas_rect.width = 8000; }))
      << "stream elsewhere";
  EXPECT_TRUE(invalid([](Packet& p) { p.views[1].atlas_rect.width = 8192; }))
      << "beyond any texture";
}

TEST(PacketCodec, GuessesLieInTheirChunk) {
  Packet packet = full_packet();
  packet.chunks[0].guessed = {{2, 3}, {7, 1}, {17, 1}};
  const auto read = decode_packet(encode_packet(packet));
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->chunks[0].guessed, packet.chunks[0].guessed);
  using Ranges = std::vector<TriangleRange>;
  for (const Ranges& wrong : {Ranges{{17, 2}}, Ranges{{3, 0}}, Ranges{{4, 2}, {2, 1}},
                              Ranges{{2, 3}, {5, 1}}, Ranges{{0xFFFFFFFF, 2}}})
    EXPECT_TRUE(invalid([&](Packet& p) { p.chunks[0].guessed = wrong; }));
}

/// x + 3 y + 7 z over the lattice cells of the corners of a chunk's guessed triangles.
std::int64_t sum_of_guessed(const Chunk& chunk) {
  std::int64_t sum = 0;
  for (std::size_t t = 0; t < chunk.guessed.size(); ++t)
    for (int i = 0; i < 3 && chunk.guessed[t]; ++i) {
      const Vec3i cell = Lattice{}.quantize(chunk.mesh.corner(t, i));
      sum += cell.x + std::int64_t{3} * cell.y + std::int64_t{7} * cell.z;
    }
  return sum;
}

TEST(PacketCodec, GuessesAreTheTrianglesThatThePageTakesThemFor) {
  // web/tests/unit/draco.test.ts: the same sums.
  const auto packet = decode_packet(
      *read_file(std::filesystem::path(MR_SOURCE_DIR) / "web/tests/data/chunks_room.bin"));
  ASSERT_TRUE(packet) << packet.error().message;
  std::vector<std::int64_t> sums;
  for (EncodedChunk chunk : packet->chunks) {
    chunk.guessed = {{3, 4}, {11, 1}};
    const auto decoded = decode_chunk(chunk, {});
    ASSERT_TRUE(decoded) << decoded.error().message;
    sums.push_back(sum_of_guessed(*decoded));
  }
  EXPECT_EQ(sums, (std::vector<std::int64_t>{86648919, 86754940, 86915445}));
}

TEST(PacketCodec, ListsAreSortedAndUnique) {
  EXPECT_TRUE(invalid([](Packet& p) { std::swap(p.views[0], p.views[1]); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.views[1].id = p.views[0].id; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.views[2].layer = Layer::moving; }));
  EXPECT_TRUE(invalid([](Packet& p) { std::swap(p.views[1], p.views[2]); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.streams[1].stream = p.streams[0].stream; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.views[1].id = kNoView; }));
  EXPECT_TRUE(invalid([](Packet& p) { std::swap(p.sources[0], p.sources[1]); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.sources[1].sensor = p.sources[0].sensor; }));
  EXPECT_TRUE(invalid([](Packet& p) { std::swap(p.manifest[0], p.manifest[1]); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.manifest[1] = p.manifest[0]; }));
  EXPECT_TRUE(invalid([](Packet& p) { std::swap(p.chunks[0], p.chunks[1]); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.chunks[1] = p.chunks[0]; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.chunks[0].views = {ViewId{5}, ViewId{0}}; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.chunks[0].views = {ViewId{0}, kNoView}; }));
  EXPECT_TRUE(invalid([](Packet& p) { p.chunks[0].sensors = {SensorId{0}}; })) << "two kinds";
  EXPECT_TRUE(invalid([](Packet& p) { ++p.chunks[0].key.version; })) << "not in the manifest";
  EXPECT_TRUE(invalid([](Packet& p) { p.manifest.clear(); }));
  EXPECT_TRUE(invalid([](Packet& p) { p.chunks[1].key.id.layer = Layer::still; })) << "not named";
}

/// A small buffer may name one payload many times: what is copied stays within what came.
TEST(PacketCodec, SharedPayloadsDoNotMultiply) {
  flatbuffers::FlatBufferBuilder b;
  const auto name = b.CreateString("n");
  const std::vector<std::uint8_t> big(1u << 16, 1);
  const auto payload = b.CreateVector(big);
  std::vector<wire::ChunkKey> keys;
  std::vector<flatbuffers::Offset<wire::Chunk>> chunks;
  for (int i = 0; i < 1000; ++i) {
    keys.emplace_back(i, 0, 0, 0, 0, 0, 0);
    chunks.push_back(wire::CreateChunk(b, &keys.back(), 0, 1, 0, payload));
  }
  const auto plan = wire::CreatePlan(b);
  const auto manifest = b.CreateVectorOfStructs(keys);
  const auto list = b.CreateVector(chunks);
  const auto head = wire::CreateHead(b, name, name, plan, 0, 0, manifest);
  wire::FinishPacketBuffer(b, wire::CreatePacket(b, 0, 0, 0, 0, 0, 0, 0, list, 0, head));
  const auto out = decode_packet(test::sealed(b.GetBufferPointer(), b.GetSize()));
  ASSERT_FALSE(out);
  EXPECT_EQ(out.error().cause, Error::Cause::invalid);
}

void expect_within_limits(const Packet& p, const PacketLimits& limits) {
  EXPECT_LE(p.manifest.size(), limits.manifest_chunks);
  EXPECT_LE(p.views.size(), limits.views);
  EXPECT_LE(p.textures.size(), limits.textures);
  EXPECT_LE(p.scene.size(), limits.name_bytes);
  std::size_t bytes = 0;
  for (const EncodedChunk& c : p.chunks) {
    EXPECT_LE(c.triangles, limits.chunk_triangles);
    bytes += c.payload.size();
  }
  for (const TextureUnit& t : p.textures) {
    EXPECT_LE(std::max(t.width, t.height), limits.texture_side);
    bytes += t.data.size();
  }
  EXPECT_LE(bytes, limits.packet_bytes);
  for (const View& v : p.views) EXPECT_TRUE(v.camera().problems().empty());
  for (const SourceInfo& s : p.sources) EXPECT_TRUE(s.depth_camera.problems().empty());
}

TEST(PacketCodec, CorruptionNeverCrashes) {
  const auto good = encode_packet(full_packet());
  const PacketLimits limits{.packet_bytes = good.size()};
  std::mt19937 random(9);
  int accepted = 0;
  for (int i = 0; i < 20000; ++i) {
    auto bad = good;
    for (int flips = 1 + static_cast<int>(random() % 3); flips > 0; --flips)
      bad[random() % bad.size()] = static_cast<std::byte>(random());
    const auto out = decode_packet(test::resealed(bad), limits);
    if (!out) {
      EXPECT_EQ(out.error().message.find('\n'), std::string::npos);
      continue;
    }
    ++accepted;
    expect_within_limits(*out, limits);
  }
  EXPECT_GT(accepted, 100);
  EXPECT_LT(accepted, 19000);
}

TEST(PacketCodec, APayloadIsPassedOnByPointer) {
  const auto bytes = std::make_shared<const std::vector<std::byte>>(encode_packet(full_packet()));
  const auto lies_in = [&](const SharedBytes& part) {
    return part.data() >= bytes->data() && part.end() <= bytes->data() + bytes->size();
  };
  const auto message = read_message(bytes);
  ASSERT_TRUE(message) << message.error().message;
  ASSERT_FALSE(message->chunks.empty());
  ASSERT_FALSE(message->textures.empty());
  EXPECT_TRUE(lies_in(message->chunks[0].payload));
  EXPECT_TRUE(lies_in(message->textures[0].data));
  EXPECT_EQ(bytes.use_count(), 1 + static_cast<long>(message->chunks.size()) +
                                   static_cast<long>(message->textures.size()));

  // What is kept holds its own bytes only; its copies share them.
  const auto packet = decode_packet(*bytes);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->chunks, message->chunks);
  EXPECT_FALSE(lies_in(packet->chunks[0].payload));
  const Packet copy = *packet;
  EXPECT_EQ(copy.chunks[0].payload.data(), packet->chunks[0].payload.data());
}

}  // namespace
}  // namespace mr::codec
