#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "mr/codec/stream_receiver.h"
#include "mr/core/lattice.h"
#include "mr/core/result.h"
#include "mr/render/renderer.h"

namespace mr::node {

/// Packets in, pixels out: draws what a client would decode. Must be used from the thread that made
/// it.
class PacketRenderer {
 public:
  /// `lattice`: the scene's. Errors as render::Renderer::create().
  static Result<PacketRenderer> create(const Lattice& lattice);

  /// Takes a packet as it came, at a time that goes on from packet to packet. The first thing that
  /// was wrong with it: corrupt bytes, packets whose base did not come (not_found) and packets
  /// older than the newest are refused whole; what is sound in others counts.
  Status accept(std::span<const std::byte> packet_bytes, TimePoint now = {});

  /// The newest capture from a viewpoint. empty until a whole scene is there, saying what it waits
  /// for; else errors as render::Renderer::draw().
  Result<ImageRgb> draw(const Camera& camera, const Pose& T_world_camera,
                        const render::RenderOptions& options = {});

  /// Name of the device that draws.
  std::string device() const { return renderer_.device(); }

 private:
  PacketRenderer(const Lattice& lattice, render::Renderer renderer);

  codec::StreamReceiver stream_;
  render::Renderer renderer_;
};

}  // namespace mr::node
