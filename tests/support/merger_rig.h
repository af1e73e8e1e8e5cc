#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <set>
#include <utility>
#include <vector>

#include "mr/node/merge_node.h"
#include "mr/node/sensor_node.h"
#include "support/packet_inbox.h"
#include "support/rays.h"
#include "support/sensor_rig.h"

/// A merger, with the sensors below it and who receives its packets, in steps of one tick.
namespace mr::test {

inline constexpr double kApart_m = 1.2;  // two sensors, side by side

/// Two sensors that see a wall, of which both see the middle.
inline Scene two_sensors() {
  return scene_of_sensors(
      {facing_the_wall({-kApart_m / 2, 0, 0}), facing_the_wall({kApart_m / 2, 0, 0})});
}
inline Scene two_sensors_with_layers() {
  Scene scene = two_sensors();
  scene.still.layers = true;
  return scene;
}
/// A scene whose rate is controlled by our model.
inline Scene rate_controlled(Scene scene, double target_mbps) {
  scene.rate.model = RateConfig::Model::ours;
  scene.rate.target_mbps = target_mbps;
  return scene;
}
/// Two sensors below an inner merger, the scene's first.
inline Scene two_sensors_below_west(Scene scene = two_sensors()) {
  scene.mergers = {{.id = "west", .inputs = {"cam-0", "cam-1"}, .deadline_ms = 50},
                   {.id = "root", .inputs = {"west"}, .deadline_ms = 50}};
  return scene;
}

/// What both of them see together.
inline double seen_together_m2(const Scene& scene) {
  const double one = seen_wall_m2(scene.sensors[0].depth_camera);
  const double height_m =
      (scene.sensors[0].depth_camera.height - 1) / scene.sensors[0].depth_camera.fy * kWall_m;
  return one + kApart_m * height_m;
}

/// The wall, and a box that the right sensor alone sees, whose top lies at y.
inline Solids box_on_the_right(double y) { return wall_with_box({1.1, y, 1.6}); }

/// A merger above sensors, and who receives its packets.
class Merger {
 public:
  explicit Merger(const Scene& scene, bool is_root = true, node::NodeClock clock = {},
                  const MergerConfig* config = nullptr)
      : scene_(scene),
        node(scene_, config ? *config : scene_.mergers.front(), is_root, std::move(clock)) {
    for (const SensorId id : all_sensors(scene_.sensors)) sensors.emplace_back(scene_, id);
  }

  const Scene& scene() const { return scene_; }
  TimePoint now() const {
    return TimePoint(std::chrono::hours(1)) + std::chrono::milliseconds(100) * tick_;
  }

  /// The bytes of a sensor's packet of this tick.
  std::vector<std::byte> sense(std::uint32_t sensor, const Solids& solids) {
    return sense(frame_of(scene_, SensorId{sensor}, tick_, solids));
  }
  std::vector<std::byte> sense(Frame frame) {
    node::SensorNode& sensor = sensors[index_of(frame.sensor)];
    const auto surface = sensor.reconstruct(std::move(frame));
    EXPECT_TRUE(surface) << surface.error().message;
    auto bytes = sensor.code(*surface);
    EXPECT_TRUE(bytes) << bytes.error().message;
    return *std::move(bytes);
  }
  Status receive(std::uint32_t sensor, const std::vector<std::byte>& bytes) {
    const auto& inputs = node.config().inputs;
    const auto input = std::ranges::find(inputs, scene_.sensors[sensor].id) - inputs.begin();
    return node.inputs().receive(static_cast<std::size_t>(input), bytes,
                                 now() + std::chrono::milliseconds(10));
  }

  /// Merges what was received, when it is due; then it is the next tick.
  Result<std::vector<std::byte>> merge() {
    ask();
    const auto captures = node.inputs().next_set(now() + std::chrono::milliseconds(80));
    ++tick_;
    if (!captures) return captures.error();
    EXPECT_TRUE(*captures) << "nothing is ready";
    captures_ = **captures;
    return node.merge(captures_);
  }
  /// A tick in which nothing comes.
  void pass() { ++tick_; }
  /// What was merged last.
  const node::CaptureSet& captures() const { return captures_; }
  /// The same, as received.
  Packet merged() { return inbox_.take(merge()); }
  /// A tick in which all sensors but some see the same.
  Packet see(const Solids& solids, const std::set<std::uint32_t>& silent = {}) {
    for (std::uint32_t i = 0; i < sensors.size(); ++i)
      EXPECT_TRUE(silent.contains(i) || receive(i, sense(i, solids)));
    return merged();
  }

  /// As received.
  DecodedScene decoded() const {
    auto out = inbox_.receiver().scene();
    EXPECT_TRUE(out) << "chunks or pictures are missing";
    return out ? *std::move(out) : DecodedScene{};
  }
  Mesh surface() const { return all_of(decoded().chunks); }
  Mesh surface(Layer layer) const {
    auto chunks = decoded().chunks;
    std::erase_if(chunks, [&](const auto& chunk) { return chunk->key.id.layer != layer; });
    return all_of(chunks);
  }
  /// Of the newest packets of all sensors together.
  std::size_t triangles_received() {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < sensors.size(); ++i)
      sum += all_of(node.inputs().receiver(i).scene()->chunks).triangles.size();
    return sum;
  }

 private:
  /// What the merger asks its inputs for, and their answers.
  void ask() {
    for (const auto& [input, request] :
         node.inputs().requests(now() + std::chrono::milliseconds(20)))
      for (node::SensorNode& sensor : sensors)
        if (sensor.id() == node.config().inputs[input])
          if (const auto answer = sensor.answer(request); !answer.empty())
            node.inputs().take_answer(input, answer, now() + std::chrono::milliseconds(30));
  }

  const Scene scene_;
  std::uint64_t tick_ = 0;
  node::CaptureSet captures_;
  PacketInbox inbox_{scene_.lattice};

 public:
  std::deque<node::SensorNode> sensors;
  node::MergeNode node;
};

/// Share of rays at the wall that meet it twice.
inline double doubled_share(const Mesh& mesh) {
  return doubled_share(mesh, {-2, -1, 0.5}, {4, 0, 0}, {0, 2, 0}, {0, 0, 1}, 0.1f, 64);
}

inline std::vector<ViewId> ids_of(const std::vector<View>& views) {
  std::vector<ViewId> out;
  for (const View& view : views) out.push_back(view.id);
  return out;
}

inline const TextureUnit* unit_of(const Packet& packet, StreamId stream) {
  const auto unit = std::ranges::find(packet.textures, stream, &TextureUnit::stream);
  return unit == packet.textures.end() ? nullptr : &*unit;
}

}  // namespace mr::test
