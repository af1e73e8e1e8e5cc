#pragma once

#include <vector>

#include "mr/core/mesh.h"

namespace mr {

/// A mesh with a colour at each vertex.
struct ColoredMesh {
  Mesh mesh;
  std::vector<Vec3f> colors;  ///< [V] linear, 0..1
};

}  // namespace mr
