#pragma once

#include <cstdint>
#include <utility>

#include "mr/kit/part.h"
#include "support/meshes.h"
#include "support/rays.h"

/// Walls that face the sensors, as parts of a merge.
namespace mr::test {

/// A wall in the plane z = 2 + offset, facing -z, from x0 to x1.
inline Mesh wall(float x0, float x1, float offset, int cells = 40, float noise = 0,
                 unsigned seed = 1) {
  return grid({x0, 1, 2 + offset}, {x1 - x0, 0, 0}, {0, -2, 0}, cells, cells, noise, seed);
}

inline kit::Part part(Mesh mesh, std::uint32_t sensor, Vec3d eye, Vec3d target = {0, 0, 2}) {
  return {std::move(mesh), 0.001f, {source(sensor, look_at(eye, target, {0, -1, 0}))}};
}

}  // namespace mr::test
