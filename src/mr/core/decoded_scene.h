#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <vector>

#include "mr/core/chunk.h"
#include "mr/core/packet.h"
#include "mr/core/vec.h"

namespace mr {

/// The alpha plane of a picture (AlphaPlane).
struct Alpha {
  int step_px = 1;
  ImageMask plane;

  /// At a place in the picture, pixel centres at whole numbers; beside it, that of its border.
  bool at(Vec2d pixel) const {
    const auto index = [&](double p, int size) {
      return static_cast<int>(std::clamp((p + 0.5) / step_px, 0.0, size - 1.0));
    };
    return *plane.at(index(pixel.x, plane.width), index(pixel.y, plane.height));
  }
  bool fits(const ImageRgb& picture) const {
    const auto count = [&](int side) { return (side + step_px - 1) / step_px; };
    return plane.width == count(picture.width) && plane.height == count(picture.height);
  }
};

/// By the stream of the picture; not null.
using AlphaPlanes = std::map<StreamId, std::shared_ptr<const Alpha>>;

/// One capture on the client's side: everything that a packet's manifest names, decoded.
struct DecodedScene {
  TimePoint captured_at{};
  std::vector<SourceInfo> sources;
  std::vector<View> views;                                       ///< sorted by id, then by layer
  std::vector<std::shared_ptr<const Chunk>> chunks;              ///< in the manifest's order
  std::map<StreamId, std::shared_ptr<const ImageRgb>> textures;  ///< by stream
  AlphaPlanes alpha;                                             ///< of pictures that have one
};

}  // namespace mr
