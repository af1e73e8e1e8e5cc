#pragma once

#include <cmath>
#include <numbers>
#include <random>

#include "mr/core/mesh.h"

/// Scenes with known answers.
namespace mr::test {

/// A flat grid of (nx × ny) cells in the plane through `origin` spanned by `u` and `v` (metres,
/// whole extent); its normal is u × v. Noise moves vertices along the normal, uniformly within ±
/// noise_m.
inline Mesh grid(Vec3f origin, Vec3f u, Vec3f v, int nx, int ny, float noise_m = 0,
                 unsigned seed = 1) {
  std::mt19937 random(seed);
  const Vec3f normal = normalized(cross(u, v));
  Mesh mesh;
  for (int j = 0; j <= ny; ++j)
    for (int i = 0; i <= nx; ++i) {
      const float jitter = noise_m * (static_cast<float>(random()) / 2147483648.0f - 1.0f);
      mesh.positions.push_back(origin + u * (static_cast<float>(i) / nx) +
                               v * (static_cast<float>(j) / ny) + normal * jitter);
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (nx + 1) + i); };
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

/// A closed sphere of rings × 2·rings facets, normals outward.
inline Mesh sphere(Vec3f center, float radius, int rings) {
  constexpr float kPi = std::numbers::pi_v<float>;
  const int columns = 2 * rings;
  Mesh mesh;
  mesh.positions.push_back(center + Vec3f{0, 0, radius});
  for (int r = 1; r < rings; ++r)
    for (int c = 0; c < columns; ++c) {
      const float polar = kPi * r / rings, turn = 2 * kPi * c / columns;
      mesh.positions.push_back(center + radius * Vec3f{std::sin(polar) * std::cos(turn),
                                                       std::sin(polar) * std::sin(turn),
                                                       std::cos(polar)});
    }
  mesh.positions.push_back(center - Vec3f{0, 0, radius});
  const auto at = [&](int r, int c) {
    return static_cast<std::uint32_t>(1 + (r - 1) * columns + c % columns);
  };
  const auto last = static_cast<std::uint32_t>(mesh.positions.size() - 1);
  for (int c = 0; c < columns; ++c) {
    mesh.triangles.push_back({0, at(1, c), at(1, c + 1)});
    for (int r = 1; r + 1 < rings; ++r) {
      mesh.triangles.push_back({at(r, c), at(r + 1, c), at(r + 1, c + 1)});
      mesh.triangles.push_back({at(r, c), at(r + 1, c + 1), at(r, c + 1)});
    }
    mesh.triangles.push_back({at(rings - 1, c), last, at(rings - 1, c + 1)});
  }
  return mesh;
}

/// A closed axis-aligned box of 12 triangles, normals outward.
inline Mesh box(Vec3f low, Vec3f high) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.positions.push_back(
        {i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z});
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

}  // namespace mr::test
