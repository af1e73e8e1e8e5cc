#pragma once

#include <cstdint>

#include "mr/core/vec.h"

namespace mr::planner {

/// A box of cubes of the chunk grid: [low, high).
struct CubeBox {
  Vec3i low, high;

  std::int64_t count() const {
    const Vec3i size = high - low;
    return std::int64_t{size.x} * size.y * size.z;
  }
  Box3d box(double chunk_m, int margin = 0) const {
    const Vec3i more{margin, margin, margin};
    return {vec_cast<double>(low - more) * chunk_m, vec_cast<double>(high + more) * chunk_m};
  }
};

/// Whether it holds a cube, or one that is up to `margin` cubes beside it.
inline bool holds(const CubeBox& cubes, Vec3i cube, int margin) {
  for (int axis = 0; axis < 3; ++axis)
    if (cube[axis] < cubes.low[axis] - margin || cube[axis] >= cubes.high[axis] + margin)
      return false;
  return true;
}

}  // namespace mr::planner
