#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "mr/node/sensor_node.h"
#include "support/packet_inbox.h"
#include "support/sensor_rig.h"

/// A sensor node in steps of one frame.
namespace mr::test {

/// The wall, and before it a box that the sensor sees in the middle of its picture.
inline Solids wall_and_box() { return wall_with_box({0, 0.1, 1.5}); }

/// A sensor node, and who receives all that it sends.
class Sensor {
 public:
  explicit Sensor(const Scene& scene, std::uint32_t index = 0, mr::node::NodeClock clock = {},
                  mr::node::StillWork still_work = mr::node::StillWork::at_once)
      : scene_(scene), id_{index}, node(scene_, id_, std::move(clock), still_work) {}

  const Scene& scene() const { return scene_; }
  Frame frame(const Solids& solids) { return frame_of(scene_, id_, frames_++, solids); }

  /// The bytes of a frame's packet.
  Result<std::vector<std::byte>> send(Frame frame) {
    const auto surface = node.reconstruct(std::move(frame));
    if (!surface) return surface.error();
    return node.code(*surface);
  }
  /// The packet itself, once it was received.
  Packet packet(Frame frame) { return inbox_.take(send(std::move(frame))); }
  Packet see(const Solids& solids) { return packet(frame(solids)); }

  /// As received.
  std::vector<std::shared_ptr<const Chunk>> chunks() const {
    auto mesh = inbox_.receiver().mesh();
    EXPECT_TRUE(mesh) << "chunks are missing";
    return mesh ? *std::move(mesh) : std::vector<std::shared_ptr<const Chunk>>{};
  }
  std::vector<std::shared_ptr<const Chunk>> chunks(Layer layer) const {
    auto out = chunks();
    std::erase_if(out, [&](const auto& chunk) { return chunk->key.id.layer != layer; });
    return out;
  }
  Mesh surface() const { return all_of(chunks()); }

 private:
  const Scene scene_;
  SensorId id_;
  std::uint64_t frames_ = 0;
  PacketInbox inbox_{scene_.lattice};

 public:
  mr::node::SensorNode node;
};

inline Scene one_sensor() { return scene_of_sensors({facing_the_wall()}); }

inline Scene with_layers() {
  Scene scene = one_sensor();
  scene.still.layers = true;
  return scene;
}

}  // namespace mr::test
