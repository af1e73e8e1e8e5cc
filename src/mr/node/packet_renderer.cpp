#include "mr/node/packet_renderer.h"

#include <string>
#include <utility>
#include <vector>

namespace mr::node {

Result<PacketRenderer> PacketRenderer::create(const Lattice& lattice) {
  auto renderer = render::Renderer::create();
  if (!renderer) return renderer.error();
  return PacketRenderer(lattice, std::move(*renderer));
}

PacketRenderer::PacketRenderer(const Lattice& lattice, render::Renderer renderer)
    : stream_(lattice), renderer_(std::move(renderer)) {}

Status PacketRenderer::accept(std::span<const std::byte> packet_bytes, TimePoint now) {
  const auto packet = stream_.read(packet_bytes, now);
  if (!packet) return packet.error();
  std::vector<Error> wrong = stream_.accept(*packet);
  if (wrong.empty()) return {};
  if (wrong.size() > 1) wrong[0].message += " (and " + std::to_string(wrong.size() - 1) + " more)";
  return wrong[0];
}

Result<ImageRgb> PacketRenderer::draw(const Camera& camera, const Pose& T_world_camera,
                                      const render::RenderOptions& options) {
  const codec::Receiver& receiver = stream_.decoded();
  const auto scene = receiver.scene();
  if (scene) return renderer_.draw(*scene, camera, T_world_camera, options);
  if (!receiver.newest_sequence())
    return Error{Error::Cause::empty, "nothing to draw: no packet was accepted"};
  return Error{Error::Cause::empty,
               "nothing to draw: " + std::to_string(receiver.missing().size()) +
                   " chunks are missing and " + std::to_string(receiver.streams_waiting().size()) +
                   " texture streams wait for a key frame"};
}

}  // namespace mr::node
