// Alpha planes in packets: what is read, refused, folded and shown.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>

#include "mr/codec/alpha_codec.h"
#include "mr/codec/coalesce.h"
#include "mr/codec/head.h"
#include "mr/codec/mesh_codec.h"
#include "mr/codec/packet_codec.h"
#include "mr/codec/receiver.h"
#include "mr/core/file.h"
#include "mr/kit/video.h"
#include "packet_generated.h"
#include "support/meshes.h"
#include "support/seal.h"
#include "support/sender.h"

namespace mr::codec {
namespace {

using test::Sender;

ImageMask checks(int width, int height) {
  ImageMask out(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) *out.at(x, y) = static_cast<std::uint8_t>((x / 4 + y / 4) % 2);
  return out;
}

AlphaPlane plane_of(StreamId stream, int step_px, const ImageMask& mask) {
  return {stream, step_px, mask.width, mask.height, encode_alpha(mask)};
}

Packet packet_with_alpha() {
  Packet out;
  out.scene = "s", out.node = "n", out.sequence = 7;
  out.alpha = {plane_of(StreamId{0}, 2, checks(40, 30)), plane_of(StreamId{3}, 16, checks(9, 1))};
  return out;
}

testing::AssertionResult refused(Error::Cause cause, const std::string& words,
                                 const std::function<void(std::vector<AlphaPlane>&)>& change,
                                 const PacketLimits& limits = {}) {
  Packet packet = packet_with_alpha();
  change(packet.alpha);
  const auto out = decode_packet(encode_packet(packet), limits);
  if (out) return testing::AssertionFailure() << "accepted";
  if (out.error().cause != cause || out.error().message.find(words) == std::string::npos)
    return testing::AssertionFailure()
           << cause_name(out.error().cause) << ": " << out.error().message;
  return testing::AssertionSuccess();
}
testing::AssertionResult invalid(const std::string& words,
                                 const std::function<void(std::vector<AlphaPlane>&)>& change) {
  return refused(Error::Cause::invalid, words, change);
}

TEST(AlphaPackets, PlanesTravel) {
  const Packet packet = packet_with_alpha();
  const auto bytes = encode_packet(packet);
  const auto back = decode_packet(bytes);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, packet);
  EXPECT_EQ(*decode_alpha(back->alpha[0].data, 40, 30), checks(40, 30));
  HeadWriter writer;
  HeadReader reader;
  Packet next = packet;
  for (int i = 0; i < 3; ++i, ++next.sequence) {
    if (i == 2) next.alpha.clear();
    const auto read = reader.read(writer.write(next));
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->alpha, next.alpha) << "of this capture alone";
  }
}

TEST(AlphaPackets, ImpossiblePlanesAreRefused) {
  for (const int step : {0, 17, 255})
    EXPECT_TRUE(invalid("impossible", [&](auto& all) { all[1].step_px = step; })) << step;
  EXPECT_TRUE(invalid("impossible", [](auto& all) { all[0].width = 0; }));
  EXPECT_TRUE(invalid("impossible", [](auto& all) { all[1].height = 0; }));
  EXPECT_TRUE(invalid("unsorted", [](auto& all) { std::swap(all[0], all[1]); }));
  EXPECT_TRUE(invalid("unsorted", [](auto& all) { all[1].stream = all[0].stream; }));
  EXPECT_TRUE(invalid("empty payload", [](auto& all) { all[0].data = {}; }));
}

TEST(AlphaPackets, TooLargePlanesAreRefused) {
  const auto refused_with = [](const PacketLimits& limits) {
    return refused(
        Error::Cause::too_large, "alpha plane", [](auto&) {}, limits);
  };
  EXPECT_TRUE(refused_with({.views = 1}));
  EXPECT_TRUE(refused_with({.alpha_pixels = 40 * 30 + 9 - 1}));
  EXPECT_FALSE(refused_with({.alpha_pixels = 40 * 30 + 9}));
  EXPECT_TRUE(refused_with({.texture_side = 39}));
  EXPECT_FALSE(refused_with({.texture_side = 40}));
  const auto refused_size = [](int width, int height) {
    return refused(Error::Cause::too_large, "too large an alpha plane",
                   [&](auto& all) { all[0].width = width, all[0].height = height; });
  };
  EXPECT_FALSE(refused_size(8192, 2047));
  EXPECT_TRUE(refused_size(8192, 2048)) << "together with the other";
  EXPECT_TRUE(refused_size(8193, 1));
  EXPECT_TRUE(refused_size(1, 65535));
}

/// A small buffer may name one payload many times: what is copied stays within what came.
TEST(AlphaPackets, SharedPayloadsDoNotMultiply) {
  flatbuffers::FlatBufferBuilder b;
  const auto name = b.CreateString("n");
  const auto payload = b.CreateVector(std::vector<std::uint8_t>(1u << 12, 1));
  std::vector<flatbuffers::Offset<wire::Alpha>> planes;
  for (std::uint32_t i = 0; i < 1000; ++i)
    planes.push_back(wire::CreateAlpha(b, i, 2, 8, 8, payload));
  const auto list = b.CreateVector(planes);
  const auto head = wire::CreateHead(b, name, name, wire::CreatePlan(b));
  wire::FinishPacketBuffer(b,
                           wire::CreatePacket(b, 0, 0, 0, 0, 0, 0, 0, 0, 0, head, 0, 0, 0, list));
  const auto out = decode_packet(test::sealed(b.GetBufferPointer(), b.GetSize()));
  ASSERT_FALSE(out);
  EXPECT_EQ(out.error().cause, Error::Cause::invalid);
}

TEST(AlphaPackets, FoldingKeepsTheNewestPlanesOnly) {
  Packet packet = packet_with_alpha();
  std::vector<PacketMessage> messages;
  for (int i = 0; i < 3; ++i, ++packet.sequence) {
    packet.alpha[0] = plane_of(StreamId{0}, 2, checks(40 + i, 30));
    messages.push_back(*decode_message(encode_packet(packet)));
    if (i == 1) packet.alpha.resize(1);
  }
  const std::vector<AlphaPlane> newest = messages.back().alpha;
  ASSERT_EQ(newest.size(), 1u);
  const PacketMessage out = coalesce(messages);
  EXPECT_EQ(out.coalesced, 2u);
  EXPECT_EQ(out.alpha, newest);
  EXPECT_EQ(decode_message(encode_message(out))->alpha, newest);

  messages = {*decode_message(encode_packet(packet))};
  ++packet.sequence, packet.alpha.clear();
  messages.push_back(*decode_message(encode_packet(packet)));
  EXPECT_TRUE(coalesce(messages).alpha.empty()) << "what the newest shows whole is whole";
}

TEST(AlphaPackets, FoldedPlanesCountAsBytes) {
  std::vector<PacketMessage> messages;
  Packet packet = packet_with_alpha();
  for (int i = 0; i < 2; ++i, ++packet.sequence) {
    messages.push_back(*decode_message(encode_packet(packet)));
    TextureUnit unit;
    unit.width = unit.height = 16;
    unit.data = std::vector<std::byte>(PacketLimits{}.packet_bytes / 2);
    messages.back().textures = {unit};
    messages.back().change.streams.reset();
  }
  messages[1].textures[0].data = std::vector<std::byte>(1);
  messages[1].alpha[0].data = std::vector<std::byte>(PacketLimits{}.packet_bytes / 2);
  EXPECT_LT(encode_message(coalesce(messages)).size(), PacketLimits{}.packet_bytes);
}

// ---- the receiver ----

constexpr int kWidth = Sender::kWidth, kHeight = Sender::kHeight;

TEST(AlphaReceiver, APlaneIsShownInItsCaptureAlone) {
  Sender sender;
  Receiver receiver({});
  for (const int step : {1, 2, 5, 16}) {
    Packet p = sender.next();
    const ImageMask mask = checks((kWidth + step - 1) / step, (kHeight + step - 1) / step);
    p.alpha = {plane_of(Sender::kStream, step, mask)};
    EXPECT_TRUE(receiver.accept(p).empty());
    const auto scene = receiver.scene();
    ASSERT_TRUE(scene);
    ASSERT_EQ(scene->alpha.size(), 1u);
    const Alpha& alpha = *scene->alpha.at(Sender::kStream);
    EXPECT_EQ(alpha.step_px, step);
    EXPECT_EQ(alpha.plane, mask);

    EXPECT_TRUE(receiver.accept(sender.quiet()).empty());
    ASSERT_TRUE(receiver.scene());
    EXPECT_TRUE(receiver.scene()->alpha.empty()) << "though the picture is the same";
    EXPECT_EQ(scene->alpha.size(), 1u) << "what was given stays";
  }
}

TEST(AlphaReceiver, APlaneOfAnotherSizeIsLeftOut) {
  Sender sender;
  Receiver receiver({});
  for (const auto& [width, height] : {std::pair{33, 24}, {32, 23}, {31, 24}, {64, 48}, {1, 1}}) {
    Packet p = sender.next();
    p.alpha = {plane_of(Sender::kStream, 2, checks(width, height))};
    EXPECT_TRUE(receiver.accept(p).empty());
    ASSERT_TRUE(receiver.scene());
    EXPECT_TRUE(receiver.scene()->alpha.empty()) << width << "x" << height;
    EXPECT_TRUE(receiver.scene()->textures.contains(Sender::kStream));
  }
}

TEST(AlphaReceiver, ABrokenPlaneLosesNothingElse) {
  Sender sender;
  Receiver receiver({});
  Packet p = sender.next();
  p.alpha = {plane_of(Sender::kStream, 2, checks(32, 24))};
  test::edit(p.alpha[0].data, [](auto& bytes) { bytes.resize(5000, std::byte{1}); });
  const auto errors = receiver.accept(p);
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_EQ(errors[0].cause, Error::Cause::invalid);
  EXPECT_EQ(errors[0].message, "stream 4: alpha plane: more bytes than it has use for");
  EXPECT_TRUE(receiver.streams_waiting().empty());
  EXPECT_TRUE(receiver.missing().empty());
  ASSERT_TRUE(receiver.scene());
  EXPECT_TRUE(receiver.scene()->textures.contains(Sender::kStream));
  EXPECT_TRUE(receiver.scene()->alpha.empty());
}

TEST(AlphaReceiver, APlaneOfAnUnknownStreamIsNothing) {
  Sender sender;
  Receiver receiver({});
  Packet p = sender.next();
  p.alpha = {plane_of(StreamId{77}, 2, checks(32, 24))};
  EXPECT_TRUE(receiver.accept(p).empty());
  ASSERT_TRUE(receiver.scene());
  EXPECT_TRUE(receiver.scene()->alpha.empty());
}

// ---- what the page is tested with ----

ImageRgb plain(std::array<std::uint8_t, 3> color) {
  ImageRgb out(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) std::copy(color.begin(), color.end(), out.at(x, y));
  return out;
}

TextureUnit key_frame(StreamId stream, std::array<std::uint8_t, 3> color) {
  auto encoder = kit::VideoEncoder::create({.width = kWidth, .height = kHeight, .qp = 10});
  auto unit = encoder->encode(plain(color), true);
  return {stream, 1, TextureCodec::h264, 0, kWidth, kHeight, true, unit->data};
}

/// A wall across the camera's way, which is the y axis.
EncodedChunk wall(Layer layer, float distance_m) {
  const Mesh mesh = test::grid({-2, distance_m, -1}, {4, 0, 0}, {0, 0, 4}, 1, 1);
  Chunk chunk{{{{0, 0, 0}, kMergedSource, layer}, 0, 1}, 0, *snap_to_lattice(mesh, {})};
  chunk.mesh.views = {{0, 2, ViewId{0}}};
  return *encode_chunk(chunk, {}, 5);
}

View camera_of(Layer layer, StreamId stream) {
  View view;
  view.width = kWidth, view.height = kHeight;
  view.fx = view.fy = 60, view.cx = 31.5, view.cy = 23.5;
  view.T_world_camera = look_at({0, 0, 1}, {0, 2, 1}, {0, 0, 1});
  view.image_rect = view.atlas_rect = {0, 0, kWidth, kHeight};
  view.stream = stream, view.layer = layer;
  return view;
}

/// Whole numbers: the plane has the disc's pixels anywhere.
ImageMask disc(int step_px) {
  ImageMask out((kWidth + step_px - 1) / step_px, (kHeight + step_px - 1) / step_px);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      const int dx = (2 * x + 1) * step_px - kWidth, dy = (2 * y + 1) * step_px - kHeight;
      *out.at(x, y) = dx * dx + dy * dy < 4 * 16 * 16;
    }
  return out;
}

constexpr StreamId kLive{0}, kPlate{1};

/// Of a moving wall before a still one: a disc of it; whole; with a plane of another size; with a
/// broken one; a disc by a coarser plane; and textured by a panorama, which is not cut.
std::vector<Packet> packets_for_the_page() {
  Packet first;
  first.scene = "fake", first.node = "root", first.epoch = 1, first.sequence = 1;
  first.views = {camera_of(Layer::moving, kLive), camera_of(Layer::still, kPlate)};
  first.chunks = {wall(Layer::moving, 2), wall(Layer::still, 2.5f)};
  for (const EncodedChunk& chunk : first.chunks) first.manifest.push_back(chunk.key);
  first.textures = {key_frame(kLive, {200, 60, 40}), key_frame(kPlate, {40, 80, 200})};
  first.streams = {{kLive, 1}, {kPlate, 1}};
  const AlphaPlane nothing_of_plate = plane_of(kPlate, 2, ImageMask(32, 24));
  first.alpha = {plane_of(kLive, 2, disc(2)), nothing_of_plate};
  std::vector<Packet> out = {first};
  const auto add = [&](const std::vector<AlphaPlane>& alpha) -> Packet& {
    Packet next = out.back();
    ++next.sequence;
    next.chunks.clear(), next.textures.clear();
    next.alpha = alpha;
    return out.emplace_back(std::move(next));
  };
  add({});
  add({plane_of(kLive, 2, ImageMask(31, 24)), nothing_of_plate});
  add({{kLive, 2, 32, 24, std::vector<std::byte>(5000)}, nothing_of_plate});
  add({plane_of(kLive, 4, disc(4))});
  add({plane_of(kLive, 4, ImageMask(16, 12))}).views[0].kind = View::Kind::equirectangular;
  return out;
}

/// web/tests/unit/packet.test.ts and tests/browser/page_test.mjs read the file: each packet after
/// its length. Chunks and pictures are what Draco and x264 made of them once.
TEST(AlphaPackets, ThePageIsTestedWithThese) {
  const auto file = std::filesystem::path(MR_SOURCE_DIR) / "web/tests/data/packets_alpha.bin";
  const std::vector<Packet> packets = packets_for_the_page();
  if (std::getenv("MR_UPDATE_GOLDEN") != nullptr) {
    std::vector<std::byte> all;
    for (const Packet& packet : packets) {
      const auto bytes = encode_packet(packet);
      for (int i = 0; i < 4; ++i)
        all.push_back(static_cast<std::byte>(bytes.size() >> (8 * i) & 0xFF));
      all.insert(all.end(), bytes.begin(), bytes.end());
    }
    ASSERT_TRUE(write_file(file, all));
  }
  const auto golden = read_file(file);
  ASSERT_TRUE(golden) << golden.error().message;
  std::span<const std::byte> rest = *golden;
  Receiver receiver({});
  for (const Packet& packet : packets) {
    ASSERT_GE(rest.size(), 4u);
    std::size_t size = 0;
    for (int i = 0; i < 4; ++i) size |= std::to_integer<std::size_t>(rest[i]) << (8 * i);
    ASSERT_LE(size, rest.size() - 4);
    const auto read = decode_packet(rest.subspan(4, size));
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->sequence, packet.sequence);
    EXPECT_EQ(read->manifest, packet.manifest);
    EXPECT_EQ(read->alpha, packet.alpha);
    EXPECT_EQ(receiver.accept(*read).size(), packet.sequence == 4 ? 1u : 0u);
    EXPECT_TRUE(receiver.scene()) << packet.sequence;
    rest = rest.subspan(4 + size);
  }
  EXPECT_TRUE(rest.empty());
}

}  // namespace
}  // namespace mr::codec
