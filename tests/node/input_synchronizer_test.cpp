#include "mr/node/input_synchronizer.h"

#include <gtest/gtest.h>

#include <random>

#include "mr/codec/alpha_codec.h"
#include "mr/codec/head.h"
#include "mr/codec/packet_codec.h"
#include "mr/codec/packet_message.h"
#include "mr/net/emulated_transport.h"
#include "support/sender.h"

namespace mr {
namespace {

using std::chrono::milliseconds;
using test::Sender;

Scene one_sensor() {
  Scene scene;
  scene.id = "test";
  SensorConfig sensor;
  sensor.id = "sender";
  scene.sensors.assign(5, sensor);  // the sender's stream has number 4
  scene.mergers = {{"root", {"sender"}, 50}};
  return scene;
}

bool same_mesh(const std::vector<std::shared_ptr<const Chunk>>& mesh,
               const std::vector<Chunk>& chunks) {
  return std::equal(
      mesh.begin(), mesh.end(), chunks.begin(), chunks.end(),
      [](const auto& a, const Chunk& b) { return a->key == b.key && a->mesh == b.mesh; });
}

/// Every message is lost with a chance of a fifth, for ten seconds of virtual time; whenever the
/// sender stands still for 500 ms, the receiver has its mesh.
TEST(InputSynchronizer, MeshEqualsTheSendersWithin500MsOfAnyLoss) {
  const Scene scene = one_sensor();
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    net::EmulatedTransport network({.delay = milliseconds(20), .loss = 0.2, .seed = seed});
    Sender sender;
    node::InputSynchronizer synchronizer(scene, scene.mergers[0], false);
    bool key_frame_wanted = true;
    const auto packets = network.subscribe("sender", [&](const net::Message& packet) {
      static_cast<void>(synchronizer.receive(0, *codec::decode_packet(*packet), network.now()));
    });
    const auto service = network.serve("sender", [&](std::span<const std::byte> question) {
      const codec::Control request = *codec::decode_control(question);
      key_frame_wanted |= request.wants_key_frame(StreamId{4});
      auto answer = sender.answer(request);
      return answer.empty() ? nullptr : net::as_message(std::move(answer));
    });
    int moves = 0, equal = 0;
    std::mt19937 random(static_cast<unsigned>(seed) + 100);
    for (int ms = 0; ms < 10'000; ms += 5) {
      const TimePoint now{milliseconds(ms)};
      network.advance(now);
      if (ms % 50 == 0) {  // 20 packets a second; half a second of change, half a second of rest
        if (ms % 1000 < 500)
          for (int i = 0; i < 2; ++i) sender.change(static_cast<int>(random() % 6));
        Packet packet = sender.next(std::exchange(key_frame_wanted, false));
        packet.captured_at = now;
        network.publish("sender", net::as_message(codec::encode_packet(packet)));
      }
      for (const auto& [input, request] : synchronizer.requests(now))
        network.request("sender", net::as_message(codec::encode_control(request)),
                        [&](const net::Message& answer) {
                          synchronizer.take_answer(0, *answer, network.now());
                        });
      if (ms % 1000 == 995) {  // 500 ms after the last change
        ++moves;
        const auto mesh = synchronizer.receiver(0).mesh();
        equal += mesh && same_mesh(*mesh, sender.chunks());
      }
    }
    EXPECT_EQ(moves, 10);
    EXPECT_EQ(equal, 10) << "seed " << seed;
    EXPECT_EQ(synchronizer.drops().total(), 0u);
    EXPECT_GT(network.drops().at("sender: lost on its link"), 40u);
  }
}

/// A sender whose packets go through bytes, one of which a test may spoil; nothing else is lost.
class SpoiltLink {
 public:
  using Spoil = std::function<void(std::vector<std::byte>&)>;

  /// Twenty packets a second for `seconds`; the one with this number is spoilt.
  void run(int from, int to, int spoilt, const Spoil& spoil) {
    for (int n = from; n < to; ++n) {
      now_ = TimePoint(std::chrono::hours(1)) + milliseconds(50) * n;
      sender_.change(n % 6);
      Packet packet = sender_.next(std::exchange(key_frame_wanted_, false));
      packet.captured_at = now_;
      auto bytes = writer_.write(packet);
      if (n == spoilt) spoil(bytes);
      refused_ += !synchronizer_.receive(0, bytes, now_);
      for (const auto& [input, request] : synchronizer_.requests(now_)) {
        key_frame_wanted_ |= request.wants_key_frame(StreamId{4});
        if (request.whole_head) writer_.ask_whole();
        if (const auto answer = sender_.answer(request); !answer.empty())
          synchronizer_.take_answer(0, answer, now_);
      }
    }
  }
  /// Whether the newest capture is there, mesh and picture.
  bool is_whole() const {
    const auto scene = synchronizer_.receiver(0).scene();
    return scene && scene->captured_at == now_ && same_mesh(scene->chunks, sender_.chunks());
  }
  int refused() const { return refused_; }

 private:
  const Scene scene_ = one_sensor();
  Sender sender_;
  codec::HeadWriter writer_;
  node::InputSynchronizer synchronizer_{scene_, scene_.mergers[0], false};
  bool key_frame_wanted_ = true;
  int refused_ = 0;
  TimePoint now_{};
};

TEST(InputSynchronizer, IsWholeWithinTwoSecondsOfAnyDamagedPacket) {
  std::mt19937 random(5);
  for (int round = 0; round < 60; ++round) {
    SpoiltLink link;
    const int spoilt = 1 + round % 40;  // also those that bring a base
    link.run(0, spoilt, -1, {});
    link.run(spoilt, spoilt + 40, spoilt, [&](std::vector<std::byte>& bytes) {
      bytes[random() % bytes.size()] ^= static_cast<std::byte>(1u << random() % 8);
    });
    EXPECT_TRUE(link.is_whole()) << "packet " << spoilt;
    EXPECT_GE(link.refused(), 1);
  }
}

TEST(InputSynchronizer, IsWholeWithinTwoSecondsOfAnyForgedSequence) {
  for (const std::uint64_t sequence :
       {UINT64_MAX, std::uint64_t{1} << 40, std::uint64_t{4000}, std::uint64_t{0}})
    for (const int spoilt : {0, 20}) {
      SpoiltLink link;
      link.run(0, spoilt, -1, {});
      link.run(spoilt, spoilt + 40, spoilt, [&](std::vector<std::byte>& bytes) {
        auto packet = *codec::decode_message(bytes);
        packet.sequence = sequence;
        packet.age = 0;
        packet.base = codec::base_of(Sender().next(true));
        auto forged = *packet.base;
        forged.sequence = sequence;
        bytes = codec::encode_packet(forged);
      });
      EXPECT_TRUE(link.is_whole()) << sequence << " as packet " << spoilt;
    }
}

TEST(InputSynchronizer, AnInputsTimesAreMovedByItsClock) {
  const Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], false);
  const TimePoint now{std::chrono::hours(1)};
  Packet packet = sender.next(true);
  packet.captured_at = packet.sources[0].captured_at = now - std::chrono::seconds(1);
  synchronizer.set_clock_offset(0, -std::chrono::seconds(1));
  ASSERT_TRUE(synchronizer.receive(0, codec::encode_packet(packet), now));
  EXPECT_EQ(synchronizer.newest(0), now);
  const auto captures = synchronizer.next_set(now + milliseconds(60));
  ASSERT_TRUE(captures && *captures);
  EXPECT_EQ((*captures)->sources[0].captured_at, now);
}

TEST(InputSynchronizer, AnIncompleteCaptureIsShownAsItWasLastWhole) {
  const Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], false);
  const Packet first = sender.next(true);
  const auto before = sender.chunks();
  ASSERT_TRUE(synchronizer.receive(0, first, first.captured_at));
  sender.change(2);
  Packet second = sender.next();
  second.chunks.clear();
  ASSERT_TRUE(synchronizer.receive(0, second, second.captured_at));
  const auto captures = synchronizer.next_set(second.captured_at + milliseconds(60));
  ASSERT_TRUE(captures && *captures);
  EXPECT_TRUE(same_mesh((*captures)->scenes[0].chunks, before));
  EXPECT_EQ((*captures)->taken, (std::vector<std::pair<std::size_t, std::uint64_t>>{{0, 100}}));
}

TEST(InputSynchronizer, AsksForKeyFramesAtMostTwiceASecond) {
  const Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], false);
  sender.next(true);  // lost
  int asked = 0;
  for (int ms = 0; ms < 2000; ms += 10) {
    const TimePoint now{milliseconds(ms)};
    if (ms % 30 == 0) static_cast<void>(synchronizer.receive(0, sender.next(), now));
    for (const auto& [input, request] : synchronizer.requests(now))
      asked += request.wants_key_frame(StreamId{4});
  }
  EXPECT_EQ(asked, 4);
}

TEST(InputSynchronizer, UnitsAreHandedOnWithTheirCapture) {
  Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], true);
  const Packet first = sender.next(true);
  ASSERT_TRUE(synchronizer.receive(0, first, first.captured_at));
  sender.change(2);
  Packet second = sender.next();
  const auto withheld = std::exchange(second.chunks, {});
  ASSERT_TRUE(synchronizer.receive(0, second, second.captured_at));
  auto captures = synchronizer.next_set(second.captured_at + milliseconds(60));
  ASSERT_TRUE(captures && *captures);
  EXPECT_EQ((*captures)->units, first.textures);  // the second one's mesh is not whole yet
  synchronizer.take_answer(0, codec::encode_chunks(withheld), second.captured_at);
  captures = synchronizer.next_set(second.captured_at + milliseconds(120));
  ASSERT_TRUE(captures && *captures);
  EXPECT_EQ((*captures)->units, second.textures);
}

TEST(InputSynchronizer, AlphaIsHandedOnWithItsCapture) {
  const Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], true);
  Packet first = sender.next(true);
  const auto plane_of = [&](int x) {
    const TextureUnit& unit = first.textures.front();
    ImageMask plane((unit.width + 1) / 2, (unit.height + 1) / 2, 1);
    *plane.at(x, 0) = 0;
    return AlphaPlane{unit.stream, 2, plane.width, plane.height, codec::encode_alpha(plane)};
  };
  first.alpha = {plane_of(1)};
  ASSERT_TRUE(synchronizer.receive(0, first, first.captured_at));
  sender.change(2);
  Packet second = sender.next();
  second.alpha = {plane_of(2)};
  const auto withheld = std::exchange(second.chunks, {});
  ASSERT_TRUE(synchronizer.receive(0, second, second.captured_at));
  auto captures = synchronizer.next_set(second.captured_at + milliseconds(60));
  ASSERT_TRUE(captures && *captures);
  EXPECT_EQ((*captures)->alpha, first.alpha);  // the second one's mesh is not whole yet
  EXPECT_EQ(*node::alpha_of(**captures).at(first.alpha[0].stream)->plane.at(1, 0), 0);
  synchronizer.take_answer(0, codec::encode_chunks(withheld), second.captured_at);
  captures = synchronizer.next_set(second.captured_at + milliseconds(120));
  ASSERT_TRUE(captures && *captures);
  EXPECT_EQ((*captures)->alpha, second.alpha);
  EXPECT_EQ(*node::alpha_of(**captures).at(first.alpha[0].stream)->plane.at(1, 0), 1);
}

TEST(InputSynchronizer, AlphaOfAnotherSensorsPictureIsRefused) {
  const Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], false);
  Packet packet = sender.next(true);
  packet.alpha = {{StreamId{7}, 2, 4, 4, codec::encode_alpha(ImageMask(4, 4))}};
  const Status refused = synchronizer.receive(0, packet, packet.captured_at);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("alpha of stream 7"), std::string::npos);
}

/// A stream without units for long: what its parent has stays good, and the next unit follows.
TEST(InputSynchronizer, QuietStreamsAreHandedOnWhenTheyGoOn) {
  const Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer inner(scene, scene.mergers[0], true);
  codec::Receiver parent({});
  TimePoint now{};
  int units = 0;
  codec::HeadWriter merger;
  codec::HeadReader heads;
  for (int i = 0; i < 200; ++i) {
    Packet packet = i == 0 || i % 70 == 69 ? sender.next(i == 0) : sender.quiet();
    now += milliseconds(100);
    packet.captured_at = now;
    ASSERT_TRUE(inner.receive(0, packet, now));
    const auto captures = inner.next_set(now + milliseconds(60));
    ASSERT_TRUE(captures && *captures);
    units += static_cast<int>((*captures)->units.size());
    Packet merged = packet;  // with the very chunks
    merged.textures = (*captures)->units;
    const auto arrived = heads.read(merger.write(merged));
    ASSERT_TRUE(arrived);
    EXPECT_TRUE(parent.accept(*arrived).empty());
    EXPECT_TRUE(parent.scene()) << i;
    EXPECT_TRUE(inner.requests(now).empty());
  }
  EXPECT_EQ(units, 3);
}

TEST(InputSynchronizer, AWishForAKeyFrameGoesToWhoHasTheStream) {
  const Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], true);
  ASSERT_TRUE(synchronizer.receive(0, sender.next(true), TimePoint{}));
  synchronizer.ask_key_frames(std::vector{StreamId{3}, StreamId{9}});
  EXPECT_TRUE(synchronizer.requests(TimePoint{}).empty());
  synchronizer.ask_key_frames(std::vector{StreamId{3}, StreamId{4}});
  const auto requests = synchronizer.requests(TimePoint{});
  ASSERT_EQ(requests.size(), 1u);
  EXPECT_EQ(requests[0].second.key_frames, std::vector{StreamId{4}});
  synchronizer.ask_key_frames();
  EXPECT_TRUE(synchronizer.requests(TimePoint{}).empty()) << "asked just now";
  EXPECT_EQ(synchronizer.requests(TimePoint{milliseconds(500)}).size(), 1u);
}

TEST(InputSynchronizer, AsksForTheBaseThatItLacksAtMostTwiceASecond) {
  const Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], false);
  codec::HeadWriter writer;
  for (int i = 0; i < 5; ++i) static_cast<void>(writer.write(sender.quiet()));
  int asked = 0;
  for (int ms = 0; ms < 2000; ms += 10) {
    const TimePoint now{milliseconds(ms)};
    if (ms % 100 == 0) {
      EXPECT_FALSE(synchronizer.receive(0, writer.write(sender.quiet()), now));
    }
    for (const auto& [input, request] : synchronizer.requests(now)) asked += request.whole_head;
  }
  EXPECT_EQ(asked, 4);
  EXPECT_EQ(synchronizer.drops().total(), 20u);
  writer.ask_whole();
  EXPECT_TRUE(synchronizer.receive(0, writer.write(sender.quiet()), TimePoint{milliseconds(2000)}));
  EXPECT_FALSE(synchronizer.requests(TimePoint{milliseconds(4000)}).at(0).second.whole_head);
}

/// The cubes of what an input brought.
std::vector<Vec3i> cubes_of(const DecodedScene& scene) {
  std::vector<Vec3i> out;
  for (const auto& chunk : scene.chunks) out.push_back(chunk->key.id.cube);
  return out;
}

TEST(InputSynchronizer, AMergerWithARegionTakesItsChunksAndThoseAround) {
  Scene scene = one_sensor();
  scene.fusion.chunk_m = 0.5;
  scene.mergers[0].region = Box3d{{1, 0, 0}, {1.5, 0.5, 0.5}};  // cube 2
  Sender sender;                                                // a row of cubes 0 to 5
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], false);
  const Packet first = sender.next(true);
  ASSERT_TRUE(synchronizer.receive(0, first, first.captured_at));
  auto captures = synchronizer.next_set(first.captured_at + milliseconds(60));
  ASSERT_TRUE(captures && *captures);
  EXPECT_EQ(cubes_of((*captures)->scenes.at(0)),
            (std::vector<Vec3i>{{1, 0, 0}, {2, 0, 0}, {3, 0, 0}}));
  EXPECT_EQ((*captures)->views.size(), 1u);

  // What is lost elsewhere is not missed.
  sender.change(5);
  Packet second = sender.next();
  second.chunks.clear();
  ASSERT_TRUE(synchronizer.receive(0, second, second.captured_at));
  EXPECT_TRUE(synchronizer.requests(second.captured_at).empty());
  captures = synchronizer.next_set(second.captured_at + milliseconds(60));
  ASSERT_TRUE(captures && *captures);
  EXPECT_EQ((*captures)->taken, (std::vector<std::pair<std::size_t, std::uint64_t>>{{0, 101}}));
}

TEST(InputSynchronizer, ARegionFarAwayStillKnowsItsSensors) {
  Scene scene = one_sensor();
  scene.mergers[0].region = Box3d{{128, 0, 0}, {129.28, 1.28, 1.28}};
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], false);
  const Packet first = sender.next(true);
  ASSERT_TRUE(synchronizer.receive(0, first, first.captured_at));
  const auto captures = synchronizer.next_set(first.captured_at + milliseconds(60));
  ASSERT_TRUE(captures && *captures);
  EXPECT_TRUE((*captures)->scenes.at(0).chunks.empty());
  EXPECT_EQ((*captures)->sources.size(), 1u);
}

TEST(InputSynchronizer, RegionsSideBySideShareOutAllTriangles) {
  Mesh mesh = test::grid({-1, -1, 0.3f}, {2, 0, 0}, {0, 2, 0.2f}, 20, 20, 0.02f, 3);
  std::vector<SensorId> sensors(mesh.triangles.size());
  for (std::size_t t = 0; t < sensors.size(); ++t) sensors[t] = sensor_at(t % 3);
  set_triangle_sensors(mesh, sensors);
  const Box3d west{{-1.28, -1.28, 0}, {0, 1.28, 1.28}}, east{{0, -1.28, 0}, {1.28, 1.28, 1.28}};
  const Mesh a = node::inside(mesh, west, 1.28), b = node::inside(mesh, east, 1.28);
  EXPECT_GT(a.triangles.size(), 300u);
  EXPECT_GT(b.triangles.size(), 300u);
  EXPECT_EQ(a.triangles.size() + b.triangles.size(), mesh.triangles.size());
  for (std::size_t t = 0; t < a.triangles.size(); ++t) ASSERT_LT(a.centroid(t).x, 0);
  for (std::size_t t = 0; t < b.triangles.size(); ++t) ASSERT_GE(b.centroid(t).x, 0);
  EXPECT_EQ(a.sensors.size(), 3u);
  EXPECT_TRUE(node::inside(mesh, {{0, 0, 2.56}, {1.28, 1.28, 3.84}}, 1.28).empty());
}

/// A view in two layers, of two sizes, would be two cameras of one name.
TEST(InputSynchronizer, ViewsOfPlatesAreRefused) {
  const Scene scene = one_sensor();
  Sender sender;
  node::InputSynchronizer synchronizer(scene, scene.mergers[0], false);
  Packet packet = sender.next(true);
  View& plate = packet.views.emplace_back(packet.views[0]);
  plate.layer = Layer::still, plate.width *= 2, plate.height *= 2;
  const Status taken = synchronizer.receive(0, packet, packet.captured_at);
  ASSERT_FALSE(taken);
  EXPECT_NE(taken.error().message.find("brings view 0 of a plate"), std::string::npos)
      << taken.error().message;
  EXPECT_EQ(taken.error().message.find('\n'), std::string::npos);
  EXPECT_EQ(synchronizer.drops().total(), 1u);
  EXPECT_FALSE(synchronizer.newest(0));
  packet.views.pop_back();
  EXPECT_TRUE(synchronizer.receive(0, packet, packet.captured_at));
}

/// Two mergers with regions bring the same sensor to their parent.
class SharedSensor : public testing::Test {
 protected:
  SharedSensor() {
    scene_.id = "test";
    scene_.sensors.resize(5);
    for (std::size_t i = 0; i < 5; ++i) scene_.sensors[i].id = "cam-" + std::to_string(i);
    MergerConfig west{.id = "west", .inputs = {"cam-0", "cam-4"}, .deadline_ms = 50};
    west.region = Box3d{{-1.28, 0, 0}, {0, 1.28, 1.28}};
    MergerConfig east = west;
    east.id = "east", east.region = Box3d{{0, 0, 0}, {1.28, 1.28, 1.28}};
    scene_.mergers = {west, east, {.id = "root", .inputs = {"west", "east"}, .deadline_ms = 50}};
  }
  /// The next packet of a child, at a time.
  static Packet next(Sender& sender, const std::string& node, TimePoint at, bool key = false) {
    Packet packet = sender.next(key);
    packet.node = node, packet.captured_at = at;
    for (SourceInfo& source : packet.sources) source.captured_at = at;
    return packet;
  }
  node::CaptureSet gather(node::InputSynchronizer& synchronizer, TimePoint now) {
    auto captures = synchronizer.next_set(now);
    EXPECT_TRUE(captures && *captures);
    return captures && *captures ? **std::move(captures) : node::CaptureSet{};
  }

  Scene scene_;
  Sender west_, east_;
};

TEST_F(SharedSensor, ViewsSourcesAndStreamsAreThoseOfTheFirstInput) {
  node::InputSynchronizer synchronizer(scene_, scene_.mergers[2], true);
  const TimePoint now{milliseconds(1000)};
  const Packet a = next(west_, "west", now, true);
  east_.next(true);  // so its next unit is another one
  for (int cube = 0; cube < 6; ++cube) east_.change(cube);
  const Packet b = next(east_, "east", now, true);
  ASSERT_NE(a.textures, b.textures);
  ASSERT_TRUE(synchronizer.receive(1, b, now));
  ASSERT_TRUE(synchronizer.receive(0, a, now));
  const node::CaptureSet captures = gather(synchronizer, now);
  EXPECT_EQ(captures.scenes.size(), 2u);
  EXPECT_EQ(captures.views, a.views);
  EXPECT_EQ(captures.sources, a.sources);
  EXPECT_EQ(captures.units, a.textures);
  EXPECT_EQ(synchronizer.drops().total(), 0u);
}

TEST_F(SharedSensor, AStreamGoesOverToAnotherInputWithAKeyFrame) {
  node::InputSynchronizer synchronizer(scene_, scene_.mergers[2], true);
  TimePoint now{milliseconds(1000)};
  ASSERT_TRUE(synchronizer.receive(0, next(west_, "west", now, true), now));
  ASSERT_TRUE(synchronizer.receive(1, next(east_, "east", now, true), now));
  EXPECT_EQ(gather(synchronizer, now).units.size(), 1u);

  now += milliseconds(2000);  // west has died
  Packet packet = next(east_, "east", now);
  ASSERT_FALSE(packet.textures.at(0).key_frame);
  ASSERT_TRUE(synchronizer.receive(1, packet, now));
  const node::CaptureSet without = gather(synchronizer, now + milliseconds(60));
  EXPECT_EQ(without.views.size(), 1u);
  EXPECT_TRUE(without.units.empty());
  const auto requests = synchronizer.requests(now + milliseconds(60));
  ASSERT_EQ(requests.size(), 1u);
  EXPECT_EQ(requests[0].first, 1u);
  EXPECT_EQ(requests[0].second.key_frames, std::vector{StreamId{4}});

  now += milliseconds(100);
  packet = next(east_, "east", now, true);
  ASSERT_TRUE(synchronizer.receive(1, packet, now));
  EXPECT_EQ(gather(synchronizer, now + milliseconds(60)).units, packet.textures);
  now += milliseconds(100);
  packet = next(east_, "east", now);
  ASSERT_TRUE(synchronizer.receive(1, packet, now));
  EXPECT_EQ(gather(synchronizer, now + milliseconds(60)).units, packet.textures);
}

TEST_F(SharedSensor, OtherSensorsAreStillRefused) {
  node::InputSynchronizer synchronizer(scene_, scene_.mergers[2], true);
  Packet packet = next(west_, "west", TimePoint{milliseconds(1000)}, true);
  packet.sources[0].sensor = SensorId{3};
  EXPECT_FALSE(synchronizer.receive(0, packet, packet.captured_at));
}

}  // namespace
}  // namespace mr
