#include "mr/merge/patches.h"

#include "mr/merge/disjoint_sets.h"

namespace mr::merge {
namespace {

constexpr double kMostAlone = 0.2;  // share of a patch under which no rival has surface

}  // namespace

bool give_up_patches(const Mesh& mesh, const std::vector<std::uint32_t>& whole,
                     std::size_t triangles, double least_m2,
                     const std::function<bool(const Loss&)>& keeps, Owned& owned) {
  const auto& margin = owned.margin;
  const auto is_own = [&](std::uint32_t v) { return margin[v] > 0; };
  DisjointSets patches(margin.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    if (is_own(a) && is_own(b)) patches.join(a, b);
    if (is_own(b) && is_own(c)) patches.join(b, c);
    if (is_own(c) && is_own(a)) patches.join(c, a);
  }
  // A third of a triangle belongs to each of its corners.
  std::vector<float> area(margin.size(), 0), alone(margin.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const float third = length(mesh.area_normal(t)) / 6;
    for (const std::uint32_t v : mesh.triangles[t]) {
      if (!is_own(v)) continue;
      const std::uint32_t patch = patches.of(v);
      area[patch] += third;
      if (!keeps(owned.loss[v])) alone[patch] += third;
    }
  }
  const auto goes = [&](std::uint32_t v) {
    if (!is_own(v)) return false;
    const std::uint32_t patch = patches.of(v);
    return area[patch] < least_m2 && alone[patch] <= kMostAlone * area[patch];
  };
  owned.given_up_vertex.assign(margin.size(), 0);
  bool any = false;
  for (std::uint32_t v = 0; v < margin.size(); ++v)
    if (goes(v)) owned.given_up_vertex[v] = 1, any = true;
  if (!any) {
    owned.given_up_vertex.clear();
    return false;
  }
  owned.given_up.assign(triangles, 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    owned.given_up[whole.empty() ? t : whole[t]] |=
        owned.given_up_vertex[a] | owned.given_up_vertex[b] | owned.given_up_vertex[c];
  }
  for (std::uint32_t v = 0; v < margin.size(); ++v)
    if (owned.given_up_vertex[v]) owned.margin[v] = -margin[v];
  return true;
}

}  // namespace mr::merge
