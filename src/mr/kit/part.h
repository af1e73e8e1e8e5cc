#pragma once

#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/packet.h"

namespace mr::kit {

/// An input of a merge: the surface that one child (sensor or merger) sent, and the sensors it came
/// from.
struct Part {
  Mesh mesh;
  float error_m = 0;                ///< geometric error made so far
  std::vector<SourceInfo> sources;  ///< at least one
};

}  // namespace mr::kit
