#pragma once

#include <cstddef>
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

/// How many triangles all parts have together.
inline std::size_t triangles_of(const std::vector<Part>& parts) {
  std::size_t sum = 0;
  for (const Part& part : parts) sum += part.mesh.triangles.size();
  return sum;
}

}  // namespace mr::kit
