#include "mr/node/packet_renderer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "mr/codec/packet_codec.h"
#include "support/sender.h"

namespace mr::node {
namespace {

using test::Sender;

/// The camera of the sender's view.
Camera sender_camera() {
  Camera c;
  c.width = Sender::kWidth, c.height = Sender::kHeight;
  c.fx = c.fy = 60, c.cx = 32, c.cy = 24;
  return c;
}

PacketRenderer make_renderer() {
  auto made = PacketRenderer::create({});
  if (!made) ADD_FAILURE() << made.error().message;
  return std::move(*made);
}

/// Largest difference from the sender's picture where its view textures what its camera sees.
double distance_to_picture(const ImageRgb& drawn, std::uint64_t sequence) {
  const ImageRgb sent = Sender::picture(sequence);
  double most = 0;
  for (int y = 26; y < 44; ++y)
    for (int x = 34; x < 62; ++x)
      for (int c = 0; c < 3; ++c)
        most = std::max(most, std::abs(drawn.at(x, y)[c] - 1.0 * sent.at(x, y)[c]));
  return most;
}

TEST(PacketRenderer, DrawsWhatAClientWouldDecode) {
  Sender sender;
  PacketRenderer renderer = make_renderer();
  EXPECT_FALSE(renderer.device().empty());
  for (int i = 0; i < 4; ++i) {
    const Packet packet = sender.next();
    const auto bytes = codec::encode_packet(packet);
    ASSERT_TRUE(renderer.accept(bytes));
    const auto drawn = renderer.draw(sender_camera(), {});
    ASSERT_TRUE(drawn) << drawn.error().message;
    EXPECT_LT(distance_to_picture(*drawn, packet.sequence), 24);  // the video's loss
    EXPECT_GT(distance_to_picture(*drawn, packet.sequence + 8), 100);
    EXPECT_EQ(drawn->at(5, 5)[0], 128) << "background";
    const auto lower = renderer.draw(sender_camera(), {{}, {0, 0.6, 0}});
    ASSERT_TRUE(lower);
    EXPECT_EQ(lower->at(40, 36)[0], 176) << "no view";
    sender.change(i);
  }
}

TEST(PacketRenderer, PixelsAreThoseOfReceiverAndRenderer) {
  Sender sender;
  PacketRenderer renderer = make_renderer();
  codec::Receiver receiver({});
  auto plain = render::Renderer::create();
  ASSERT_TRUE(plain);
  Camera panorama;
  panorama.model = CameraModel::equirectangular;
  panorama.width = 128, panorama.height = 64;
  for (int i = 0; i < 3; ++i) {
    const Packet packet = sender.next();
    ASSERT_TRUE(renderer.accept(codec::encode_packet(packet)));
    ASSERT_TRUE(receiver.accept(packet).empty());
    for (const Camera& camera : {sender_camera(), panorama}) {
      const Pose pose{{}, {0.3, 0.2, 0.1 * i}};
      const render::RenderOptions options{.background = {1, 2, 3}};
      const auto drawn = renderer.draw(camera, pose, options);
      ASSERT_TRUE(drawn);
      EXPECT_EQ(*drawn, *plain->draw(*receiver.scene(), camera, pose, options));
    }
    sender.change(i);
  }
}

TEST(PacketRenderer, CorruptBytesAreRefusedAndChangeNothing) {
  Sender sender;
  PacketRenderer renderer = make_renderer();
  const auto good = codec::encode_packet(sender.next());
  const auto refused = [&](std::span<const std::byte> bytes) {
    const auto taken = renderer.accept(bytes);
    return !taken && !taken.error().message.empty();
  };
  EXPECT_TRUE(refused({}));
  EXPECT_TRUE(refused(std::span(good).first(good.size() / 2)));
  ASSERT_TRUE(renderer.accept(good));
  const auto before = renderer.draw(sender_camera(), {});
  ASSERT_TRUE(before);
  EXPECT_TRUE(refused(std::span(good).first(good.size() - 9)));
  EXPECT_TRUE(refused(std::vector<std::byte>(1000, std::byte{0xA5})));
  const auto after = renderer.draw(sender_camera(), {});
  ASSERT_TRUE(after);
  EXPECT_EQ(*before, *after);
}

TEST(PacketRenderer, OlderPacketsAreRefused) {
  Sender sender;
  PacketRenderer renderer = make_renderer();
  const auto first = codec::encode_packet(sender.next()),
             second = codec::encode_packet(sender.next());
  ASSERT_TRUE(renderer.accept(first));
  ASSERT_TRUE(renderer.accept(second));
  const auto taken = renderer.accept(first);
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().cause, Error::Cause::invalid);
}

TEST(PacketRenderer, IsEmptyUntilAWholeSceneIsThere) {
  Sender sender;
  PacketRenderer renderer = make_renderer();
  const auto message = [&] {
    const auto drawn = renderer.draw(sender_camera(), {});
    if (drawn) return std::string("drawn");
    EXPECT_EQ(drawn.error().cause, Error::Cause::empty);
    return drawn.error().message;
  };
  EXPECT_NE(message().find("no packet"), std::string::npos);
  sender.next();  // lost, with all chunks and the key frame
  ASSERT_TRUE(renderer.accept(codec::encode_packet(sender.next())));
  EXPECT_NE(message().find("6 chunks are missing"), std::string::npos);
  EXPECT_NE(message().find("1 texture streams wait"), std::string::npos);
  for (int cube = 0; cube < 6; ++cube) sender.change(cube);
  ASSERT_TRUE(renderer.accept(codec::encode_packet(sender.next(true))));
  EXPECT_EQ(message(), "drawn");
}

TEST(PacketRenderer, ImpossibleCamerasAreErrors) {
  Sender sender;
  PacketRenderer renderer = make_renderer();
  ASSERT_TRUE(renderer.accept(codec::encode_packet(sender.next())));
  Camera camera = sender_camera();
  camera.width = 0;
  const auto drawn = renderer.draw(camera, {});
  ASSERT_FALSE(drawn);
  EXPECT_EQ(drawn.error().cause, Error::Cause::invalid);
}

}  // namespace
}  // namespace mr::node
