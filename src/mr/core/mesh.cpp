#include "mr/core/mesh.h"

#include <algorithm>
#include <numeric>

#include "mr/core/assert.h"

namespace mr {

std::vector<ViewId> triangle_views(const Mesh& mesh) {
  std::vector<ViewId> views(mesh.triangles.size(), kNoView);
  for (const ViewRun& run : mesh.runs) {
    MR_ASSERT(run.first + run.count <= views.size());
    std::fill_n(views.begin() + run.first, run.count, run.view);
  }
  return views;
}

void set_triangle_views(Mesh& mesh, const std::vector<ViewId>& views) {
  MR_ASSERT(views.size() == mesh.triangles.size());
  std::vector<std::uint32_t> order(views.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return views[a] < views[b]; });
  std::vector<Triangle> sorted(order.size());
  mesh.runs.clear();
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    sorted[i] = mesh.triangles[order[i]];
    const ViewId view = views[order[i]];
    if (mesh.runs.empty() || mesh.runs.back().view != view) mesh.runs.push_back({i, 0, view});
    ++mesh.runs.back().count;
  }
  mesh.triangles = std::move(sorted);
}

Mesh select_triangles(const Mesh& mesh, const std::vector<std::uint8_t>& keep) {
  MR_ASSERT(keep.size() == mesh.triangles.size());
  constexpr std::uint32_t kUnused = 0xFFFFFFFFu;
  std::vector<std::uint32_t> new_index(mesh.positions.size(), kUnused);
  const std::vector<ViewId> views = triangle_views(mesh);
  Mesh out;
  std::vector<ViewId> kept_views;
  for (std::size_t t = 0; t < keep.size(); ++t) {
    if (!keep[t]) continue;
    Triangle triangle = mesh.triangles[t];
    for (std::uint32_t& v : triangle) {
      if (new_index[v] == kUnused) {
        new_index[v] = static_cast<std::uint32_t>(out.positions.size());
        out.positions.push_back(mesh.positions[v]);
      }
      v = new_index[v];
    }
    out.triangles.push_back(triangle);
    kept_views.push_back(views[t]);
  }
  if (!mesh.runs.empty()) set_triangle_views(out, kept_views);
  return out;
}

void append(Mesh& mesh, const Mesh& other) {
  const bool labelled = !mesh.runs.empty() || !other.runs.empty();
  std::vector<ViewId> views = triangle_views(mesh);
  const auto base = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  mesh.triangles.reserve(mesh.triangles.size() + other.triangles.size());
  for (const Triangle& t : other.triangles)
    mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  if (!labelled) return;
  const std::vector<ViewId> more = triangle_views(other);
  views.insert(views.end(), more.begin(), more.end());
  set_triangle_views(mesh, views);
}

double surface_area_m2(const Mesh& mesh) {
  double twice = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) twice += length(mesh.area_normal(t));
  return twice / 2;
}

}  // namespace mr
