#pragma once

#include <map>
#include <memory>
#include <vector>

#include "mr/core/chunk.h"
#include "mr/core/packet.h"

namespace mr {

/// The alpha plane of a picture (AlphaPlane).
struct Alpha {
  int step_px = 1;
  ImageMask plane;

  bool fits(const ImageRgb& picture) const {
    const auto count = [&](int side) { return (side + step_px - 1) / step_px; };
    return plane.width == count(picture.width) && plane.height == count(picture.height);
  }
};

/// One capture on the client's side: everything that a packet's manifest names, decoded.
struct DecodedScene {
  TimePoint captured_at{};
  std::vector<SourceInfo> sources;
  std::vector<View> views;                                       ///< sorted by id, then by layer
  std::vector<std::shared_ptr<const Chunk>> chunks;              ///< in the manifest's order
  std::map<StreamId, std::shared_ptr<const ImageRgb>> textures;  ///< by stream
  std::map<StreamId, std::shared_ptr<const Alpha>> alpha;  ///< of pictures that have one
};

}  // namespace mr
