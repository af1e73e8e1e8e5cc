#include "mr/kit/hole_filling.h"

#include <algorithm>
#include <vector>

#include "mr/kit/borders.h"

namespace mr::kit {
namespace {

constexpr std::size_t kMostCorners = 16;

double perimeter_m(const Mesh& mesh, const BorderLoop& loop) {
  double out = 0;
  for (std::size_t i = 0; i < loop.size(); ++i)
    out += length(mesh.positions[loop[(i + 1) % loop.size()]] - mesh.positions[loop[i]]);
  return out;
}

/// The holes with a perimeter of at most `max_perimeter_m` that touch no other border.
std::vector<BorderLoop> small_holes(const Mesh& mesh, const Borders& borders,
                                    double max_perimeter_m) {
  std::vector<std::uint8_t> loops_at(mesh.positions.size(), 0);  // 2: two or more
  for (const BorderLoop& loop : borders.loops())
    for (const std::uint32_t v : loop) loops_at[v] = loops_at[v] ? 2 : 1;
  std::vector<BorderLoop> out;
  for (const BorderLoop& loop : borders.loops())
    if (loop.size() <= kMostCorners &&
        std::ranges::none_of(loop, [&](std::uint32_t v) { return loops_at[v] > 1; }) &&
        perimeter_m(mesh, loop) <= max_perimeter_m)
      out.push_back(loop);
  return out;
}

/// Fills a hole by ear clipping, shortest diagonal first; empty: not possible. Border edges run
/// around the hole with the surface on their left.
std::vector<Triangle> filling(const Mesh& mesh, const Borders& borders, BorderLoop corners) {
  std::vector<Triangle> out;
  const auto at = [&](std::size_t i) { return corners[i % corners.size()]; };
  while (corners.size() > 3) {
    std::size_t best = corners.size();
    float least = 0;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const float across = length(mesh.positions[at(i + 2)] - mesh.positions[at(i)]);
      if ((best == corners.size() || across < least) && !borders.has_edge(at(i), at(i + 2)))
        best = i, least = across;
    }
    if (best == corners.size()) return {};
    out.push_back({at(best + 2), at(best + 1), at(best)});
    corners.erase(corners.begin() + static_cast<std::ptrdiff_t>((best + 1) % corners.size()));
  }
  out.push_back({corners[2], corners[1], corners[0]});
  return out;
}

Vec3f area_normal(const Mesh& mesh, const Triangle& t) {
  const Vec3f a = mesh.positions[t[0]];
  return cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
}

/// Sums of the surface's normals at the vertices that are asked for; zero elsewhere.
std::vector<Vec3f> normals_at(const Mesh& mesh, const std::vector<std::uint8_t>& wanted) {
  std::vector<Vec3f> out(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    if (!(wanted[t[0]] | wanted[t[1]] | wanted[t[2]])) continue;
    const Vec3f n = normalized(area_normal(mesh, t));
    for (const std::uint32_t v : t) out[v] += n;
  }
  return out;
}

}  // namespace

void fill_small_holes(Mesh& mesh, double max_perimeter_m) {
  Borders borders(mesh);
  const std::vector<BorderLoop> holes = small_holes(mesh, borders, max_perimeter_m);
  if (holes.empty()) return;
  std::vector<std::uint8_t> at_hole(mesh.positions.size(), 0);
  for (const BorderLoop& hole : holes)
    for (const std::uint32_t v : hole) at_hole[v] = 1;
  const std::vector<Vec3f> normals = normals_at(mesh, at_hole);
  bool any = false;
  for (const BorderLoop& hole : holes) {
    const std::vector<Triangle> patch = filling(mesh, borders, hole);
    const bool fits = !patch.empty() && std::ranges::all_of(patch, [&](const Triangle& t) {
      return dot(area_normal(mesh, t), normals[t[0]] + normals[t[1]] + normals[t[2]]) > 0;
    });
    if (!fits) continue;
    for (const Triangle& t : patch) {
      mesh.triangles.push_back(t);
      for (int i = 0; i < 3; ++i) borders.add_edge(t[i], t[(i + 1) % 3]);
    }
    any = true;
  }
  if (any) clear_labels(mesh);
}

}  // namespace mr::kit
