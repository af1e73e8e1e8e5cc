#pragma once

#include <algorithm>
#include <cstdint>

#include "mr/core/vec.h"

namespace mr::merge {

/// The cell of a grid of unit cubes that a point lies in; at most a million cells from the origin.
inline Vec3i cell_at(Vec3f p) {
  const auto whole = [](float x) {
    const float inside = std::clamp(x, -1e6f, 1e6f);
    const auto towards_0 = static_cast<std::int32_t>(inside);
    return towards_0 - (inside < static_cast<float>(towards_0));
  };
  return {whole(p.x), whole(p.y), whole(p.z)};
}

}  // namespace mr::merge
