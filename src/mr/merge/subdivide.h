#pragma once

namespace mr::merge {

/// Subdivides a triangle abc into n² congruent triangles: calls visit(b, c) with the barycentric
/// weights of b and c at each centroid.
template <typename Visit>
void for_each_subtriangle(int n, Visit&& visit) {
  const float step = 1 / static_cast<float>(n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; i + j < n; ++j) {
      const auto x = static_cast<float>(i), y = static_cast<float>(j);
      visit((x + 1.0f / 3) * step, (y + 1.0f / 3) * step);
      if (i + j + 1 < n) visit((x + 2.0f / 3) * step, (y + 2.0f / 3) * step);
    }
}

}  // namespace mr::merge
