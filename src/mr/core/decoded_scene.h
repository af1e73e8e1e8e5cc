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

  /// The plane's column and row at a place in the picture, pixel centres at whole numbers; beside
  /// it, those of its border.
  int column(double x) const { return index(x, plane.width); }
  int row(double y) const { return index(y, plane.height); }
  bool at(Vec2d pixel) const { return *plane.at(column(pixel.x), row(pixel.y)); }
  bool fits(const ImageRgb& picture) const {
    const auto count = [&](int side) { return (side + step_px - 1) / step_px; };
    return plane.width == count(picture.width) && plane.height == count(picture.height);
  }

 private:
  int index(double p, int size) const {
    return static_cast<int>(std::clamp((p + 0.5) / step_px, 0.0, size - 1.0));
  }
};

/// By the stream of the picture; not null.
using AlphaByStream = std::map<StreamId, std::shared_ptr<const Alpha>>;

/// One capture on the client's side: everything that a packet's manifest names, decoded.
struct DecodedScene {
  TimePoint captured_at{};
  std::vector<SourceInfo> sources;
  std::vector<View> views;                                       ///< sorted by id, then by layer
  std::vector<std::shared_ptr<const Chunk>> chunks;              ///< in the manifest's order
  std::map<StreamId, std::shared_ptr<const ImageRgb>> textures;  ///< by stream
  AlphaByStream alpha;                                           ///< of pictures that have one
};

}  // namespace mr
