#include "mr/baseline/decimate.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/simplify/simplify.h"

namespace mr::baseline {
namespace {

/// The triangles of each cube, cubes in order.
std::vector<std::vector<std::uint32_t>> triangles_by_cube(const Mesh& mesh, double cube_m,
                                                          double shift) {
  const auto cell = [&](float v) {
    return static_cast<std::int32_t>(std::floor(v / cube_m + shift));
  };
  std::map<Vec3i, std::vector<std::uint32_t>> cubes;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f at = mesh.centroid(t);
    cubes[{cell(at.x), cell(at.y), cell(at.z)}].push_back(t);
  }
  std::vector<std::vector<std::uint32_t>> out;
  for (auto& [cube, triangles] : cubes) out.push_back(std::move(triangles));
  return out;
}

/// [V] whether triangles of several cubes meet there.
std::vector<std::uint8_t> shared_vertices(const Mesh& mesh,
                                          const std::vector<std::vector<std::uint32_t>>& cubes) {
  constexpr std::uint32_t kNobody = 0xFFFFFFFFu;
  std::vector<std::uint32_t> owner(mesh.positions.size(), kNobody);
  std::vector<std::uint8_t> shared(mesh.positions.size(), 0);
  for (std::uint32_t c = 0; c < cubes.size(); ++c)
    for (const std::uint32_t t : cubes[c])
      for (const std::uint32_t v : mesh.triangles[t]) {
        shared[v] |= owner[v] != kNobody && owner[v] != c;
        owner[v] = c;
      }
  return shared;
}

/// One cube's triangles. A vertex at which two fans meet stays where it is in simplify(): each
/// shared one gets a small triangle of its own, whose tips are remembered to find it again.
struct CubeMesh {
  Mesh mesh;
  std::vector<Vec3f> tips;  ///< sorted
};

CubeMesh make_cube_mesh(const Mesh& mesh, const std::vector<std::uint32_t>& triangles,
                        const std::vector<std::uint8_t>& shared) {
  constexpr float kSize_m = 0.00037f;
  std::vector<std::uint32_t> used;  // vertices of the mesh, sorted
  for (const std::uint32_t t : triangles)
    used.insert(used.end(), mesh.triangles[t].begin(), mesh.triangles[t].end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  CubeMesh out;
  for (const std::uint32_t v : used) out.mesh.positions.push_back(mesh.positions[v]);
  for (const std::uint32_t t : triangles) {
    Triangle& triangle = out.mesh.triangles.emplace_back(mesh.triangles[t]);
    for (std::uint32_t& v : triangle)
      v = static_cast<std::uint32_t>(std::lower_bound(used.begin(), used.end(), v) - used.begin());
  }
  for (std::uint32_t i = 0; i < used.size(); ++i) {
    if (!shared[used[i]]) continue;
    const auto tip = static_cast<std::uint32_t>(out.mesh.positions.size());
    const Vec3f at = mesh.positions[used[i]];
    out.tips.push_back(at + Vec3f{kSize_m, 0, 0});
    out.mesh.positions.push_back(out.tips.back());
    out.mesh.positions.push_back(at + Vec3f{0, kSize_m, 0});
    out.mesh.triangles.push_back({i, tip, tip + 1});
  }
  std::sort(out.tips.begin(), out.tips.end());
  return out;
}

Decimated decimate_cube(const CubeMesh& piece, double ratio) {
  const auto own = static_cast<double>(piece.mesh.triangles.size() - piece.tips.size());
  const auto target = static_cast<std::size_t>(std::ceil(own * ratio)) + piece.tips.size();
  const simplify::Simplified small = *simplify::simplify(piece.mesh, {.triangles = target});
  std::vector<std::uint8_t> keep(small.mesh.triangles.size(), 1);
  for (std::size_t t = 0; t < keep.size(); ++t)
    for (int i = 0; i < 3; ++i)
      if (std::binary_search(piece.tips.begin(), piece.tips.end(), small.mesh.corner(t, i)))
        keep[t] = 0;
  return {select_triangles(small.mesh, keep), small.error_m};
}

/// Cut, decimated and joined again.
Decimated one_round(const Mesh& mesh, double ratio, double cube_m, double shift) {
  const auto cubes = triangles_by_cube(mesh, cube_m, shift);
  const auto shared = shared_vertices(mesh, cubes);
  std::vector<Decimated> pieces(cubes.size());
  parallel_for(cubes.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c)
      pieces[c] = decimate_cube(make_cube_mesh(mesh, cubes[c], shared), ratio);
  });
  Decimated out;
  for (const Decimated& piece : pieces) {
    append(out.mesh, piece.mesh);
    out.error_m = std::max(out.error_m, piece.error_m);
  }
  out.mesh = kit::weld(out.mesh);
  return out;
}

}  // namespace

Decimated decimate(const Mesh& mesh, double ratio, double cube_m) {
  if (ratio >= 1) return {mesh, 0};
  const Decimated first = one_round(mesh, std::sqrt(ratio), cube_m, 0);
  const double left = ratio * static_cast<double>(mesh.triangles.size()) /
                      static_cast<double>(std::max<std::size_t>(first.mesh.triangles.size(), 1));
  Decimated out = one_round(first.mesh, std::min(1.0, left), cube_m, 0.5);
  out.error_m += first.error_m;
  return out;
}

}  // namespace mr::baseline
