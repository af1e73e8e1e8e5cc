#include "mr/node/gatherer.h"

#include <gtest/gtest.h>

#include <deque>
#include <random>

#include "mr/codec/packet_codec.h"
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

/// A network that loses packets, requests and answers, and takes 20 ms one way.
class Network {
 public:
  Network(double loss, unsigned seed) : loss_(loss), random_(seed) {}

  void send(TimePoint now, std::function<void()> arrive) {
    if (std::uniform_real_distribution<>(0, 1)(random_) < loss_) return;
    under_way_.emplace_back(now + milliseconds(20), std::move(arrive));
  }
  void deliver(TimePoint now) {
    while (!under_way_.empty() && under_way_.front().first <= now) {
      const auto arrive = std::move(under_way_.front().second);
      under_way_.pop_front();
      arrive();
    }
  }

 private:
  double loss_;
  std::mt19937 random_;
  std::deque<std::pair<TimePoint, std::function<void()>>> under_way_;
};

/// A fifth of all packets is lost for ten seconds of virtual time; whenever the sender stands still
/// for 500 ms, the receiver has its mesh.
TEST(Gatherer, MeshEqualsTheSendersWithin500MsOfAnyLoss) {
  const Scene scene = one_sensor();
  for (const unsigned seed : {1u, 2u, 3u}) {
    Sender sender;
    node::Gatherer gatherer(scene, scene.mergers[0], false);
    Network network(0.2, seed);
    bool key_frame_wanted = true;
    int moves = 0, equal = 0;
    std::mt19937 random(seed + 100);
    for (int ms = 0; ms < 10'000; ms += 5) {
      const TimePoint now{milliseconds(ms)};
      if (ms % 50 == 0) {  // 20 packets a second; half a second of change, half a second of rest
        if (ms % 1000 < 500)
          for (int i = 0; i < 2; ++i) sender.change(static_cast<int>(random() % 6));
        Packet packet = sender.next(std::exchange(key_frame_wanted, false));
        packet.captured_at = now;
        network.send(now, [&, packet, now] {
          static_cast<void>(gatherer.receive(0, packet, now + milliseconds(20)));
        });
      }
      network.deliver(now);
      for (const auto& [input, request] : gatherer.requests(now))
        network.send(now, [&, request = request, now] {
          key_frame_wanted |= request.key_frame;
          const auto answer = sender.answer(request);
          if (!answer.empty())
            network.send(now + milliseconds(20), [&, answer, now] {
              gatherer.take_answer(0, answer, now + milliseconds(40));
            });
        });
      if (ms % 1000 == 995) {  // 500 ms after the last change
        ++moves;
        const auto mesh = gatherer.receiver(0).mesh();
        equal += mesh && same_mesh(*mesh, sender.chunks());
      }
    }
    EXPECT_EQ(moves, 10);
    EXPECT_EQ(equal, 10) << "seed " << seed;
    EXPECT_EQ(gatherer.drops().total(), 0u);
  }
}

TEST(Gatherer, AnIncompleteCaptureIsShownAsItWasLastWhole) {
  const Scene scene = one_sensor();
  Sender sender;
  node::Gatherer gatherer(scene, scene.mergers[0], false);
  const Packet first = sender.next(true);
  const auto before = sender.chunks();
  ASSERT_TRUE(gatherer.receive(0, first, first.captured_at));
  sender.change(2);
  Packet second = sender.next();
  second.chunks.clear();
  ASSERT_TRUE(gatherer.receive(0, second, second.captured_at));
  const auto gathered = gatherer.gather(second.captured_at + milliseconds(60));
  ASSERT_TRUE(gathered && *gathered);
  EXPECT_TRUE(same_mesh((*gathered)->scenes[0].chunks, before));
  EXPECT_EQ((*gathered)->taken, (std::vector<std::pair<std::size_t, std::uint64_t>>{{0, 100}}));
}

TEST(Gatherer, AsksForKeyFramesAtMostTwiceASecond) {
  const Scene scene = one_sensor();
  Sender sender;
  node::Gatherer gatherer(scene, scene.mergers[0], false);
  sender.next(true);  // lost
  int asked = 0;
  for (int ms = 0; ms < 2000; ms += 10) {
    const TimePoint now{milliseconds(ms)};
    if (ms % 30 == 0) static_cast<void>(gatherer.receive(0, sender.next(), now));
    for (const auto& [input, request] : gatherer.requests(now)) asked += request.key_frame;
  }
  EXPECT_EQ(asked, 4);
}

TEST(Gatherer, UnitsAreHandedOnWithTheirCapture) {
  Scene scene = one_sensor();
  Sender sender;
  node::Gatherer gatherer(scene, scene.mergers[0], true);
  const Packet first = sender.next(true);
  ASSERT_TRUE(gatherer.receive(0, first, first.captured_at));
  sender.change(2);
  Packet second = sender.next();
  const auto withheld = std::exchange(second.chunks, {});
  ASSERT_TRUE(gatherer.receive(0, second, second.captured_at));
  auto gathered = gatherer.gather(second.captured_at + milliseconds(60));
  ASSERT_TRUE(gathered && *gathered);
  EXPECT_EQ((*gathered)->units, first.textures);  // the second one's mesh is not whole yet
  gatherer.take_answer(0, codec::encode_chunks(withheld), second.captured_at);
  gathered = gatherer.gather(second.captured_at + milliseconds(120));
  ASSERT_TRUE(gathered && *gathered);
  EXPECT_EQ((*gathered)->units, second.textures);
}

}  // namespace
}  // namespace mr
