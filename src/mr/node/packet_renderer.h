#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "mr/codec/stream_receiver.h"
#include "mr/core/lattice.h"
#include "mr/core/result.h"
#include "mr/render/renderer.h"

namespace mr::node {

/// Decodes packets as a client does and renders the scene. To be used only on the thread that
/// created it.
class PacketRenderer {
 public:
  /// `lattice`: the scene's. Errors as render::Renderer::create().
  static Result<PacketRenderer> create(const Lattice& lattice);

  /// Takes the bytes of a packet; `now` must not decrease. Returns the first error found. Corrupt
  /// bytes, packets whose base was lost (not_found) and packets older than the newest are refused
  /// as a whole; of other packets, the valid payloads are used.
  Status accept(std::span<const std::byte> packet_bytes, TimePoint now = {});

  /// Renders the newest complete capture from a viewpoint. Error empty: there is none yet, and the
  /// message says what is missing; other errors as render::Renderer::draw().
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
