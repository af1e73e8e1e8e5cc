#pragma once

#include <map>
#include <memory>
#include <vector>

#include "mr/core/chunk.h"
#include "mr/core/packet.h"

namespace mr {

/// One capture on the client's side: everything that a packet's manifest names, decoded.
struct DecodedScene {
  TimePoint captured_at{};
  std::vector<SourceInfo> sources;
  std::vector<View> views;                                       ///< sorted by id, then by layer
  std::vector<std::shared_ptr<const Chunk>> chunks;              ///< in the manifest's order
  std::map<StreamId, std::shared_ptr<const ImageRgb>> textures;  ///< by stream
};

}  // namespace mr
