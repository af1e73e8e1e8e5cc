#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "mr/core/vec.h"

namespace mr::merge {

/// The cell of a unit grid that contains a point, clamped to a million cells from the origin.
inline Vec3i cell_at(Vec3f p) {
  const auto whole = [](float x) {
    const float inside = std::clamp(x, -1e6f, 1e6f);
    const auto towards_0 = static_cast<std::int32_t>(inside);
    return towards_0 - (inside < static_cast<float>(towards_0));
  };
  return {whole(p.x), whole(p.y), whole(p.z)};
}

/// A unique key (for hash maps) of each such cell and of its neighbours.
inline std::uint64_t cell_key(Vec3i cell) {
  const auto bits = [](std::int32_t x) { return static_cast<std::uint64_t>(x + (1 << 20)); };
  return bits(cell.x) << 42 | bits(cell.y) << 21 | bits(cell.z);
}
inline constexpr std::array<std::uint64_t, 3> kCellStep{1ull << 42, 1ull << 21, 1};  // of a key

/// The cells that a box lies in.
struct CellBox {
  Vec3i low, high;

  float count() const {
    const Vec3f size = vec_cast<float>(high - low) + Vec3f{1, 1, 1};
    return size.x * size.y * size.z;
  }
  /// Calls work(key) for each.
  template <typename Work>
  void for_each(const Work& work) const {
    for (int x = low.x; x <= high.x; ++x)
      for (int y = low.y; y <= high.y; ++y)
        for (int z = low.z; z <= high.z; ++z) work(cell_key({x, y, z}));
  }
};

}  // namespace mr::merge
