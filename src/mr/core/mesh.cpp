#include "mr/core/mesh.h"

#include <algorithm>
#include <utility>

#include "mr/core/assert.h"

namespace mr {

namespace {

/// A mesh's runs, also when it is not labelled yet.
std::vector<ViewRun> runs_of(const Mesh& mesh) {
  if (!mesh.runs.empty() || mesh.empty()) return mesh.runs;
  return {{0, static_cast<std::uint32_t>(mesh.triangles.size()), kNoView}};
}

/// Sorts the triangles and the runs, which cover them in any order of views, by view; stable.
void take_runs(Mesh& mesh, std::vector<ViewRun> runs) {
  std::ranges::stable_sort(runs, {}, &ViewRun::view);
  std::vector<Triangle> sorted;
  sorted.reserve(mesh.triangles.size());
  mesh.runs.clear();
  for (const ViewRun& run : runs) {
    if (mesh.runs.empty() || mesh.runs.back().view != run.view)
      mesh.runs.push_back({static_cast<std::uint32_t>(sorted.size()), 0, run.view});
    mesh.runs.back().count += run.count;
    const auto begin = mesh.triangles.begin() + run.first;
    sorted.insert(sorted.end(), begin, begin + run.count);
  }
  mesh.triangles = std::move(sorted);
}

}  // namespace

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
  std::vector<ViewRun> runs;
  for (std::uint32_t t = 0; t < views.size(); ++t) {
    if (runs.empty() || runs.back().view != views[t]) runs.push_back({t, 0, views[t]});
    ++runs.back().count;
  }
  take_runs(mesh, std::move(runs));
}

Mesh select_triangles(const Mesh& mesh, const std::vector<std::uint8_t>& keep) {
  MR_ASSERT(keep.size() == mesh.triangles.size());
  constexpr std::uint32_t kUnused = 0xFFFFFFFFu;
  std::vector<std::uint32_t> new_index(mesh.positions.size(), kUnused);
  Mesh out;
  out.triangles.reserve(static_cast<std::size_t>(keep.size() - std::ranges::count(keep, 0)));
  const auto select = [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t t = begin; t < end; ++t) {
      if (!keep[t]) continue;
      Triangle& triangle = out.triangles.emplace_back(mesh.triangles[t]);
      for (std::uint32_t& v : triangle) {
        if (new_index[v] == kUnused) {
          new_index[v] = static_cast<std::uint32_t>(out.positions.size());
          out.positions.push_back(mesh.positions[v]);
        }
        v = new_index[v];
      }
    }
  };
  if (mesh.runs.empty()) select(0, static_cast<std::uint32_t>(keep.size()));
  for (const ViewRun& run : mesh.runs) {
    const auto first = static_cast<std::uint32_t>(out.triangles.size());
    select(run.first, run.first + run.count);
    const auto count = static_cast<std::uint32_t>(out.triangles.size()) - first;
    if (count > 0) out.runs.push_back({first, count, run.view});
  }
  return out;
}

void append(Mesh& mesh, const Mesh& other) {
  const auto base = static_cast<std::uint32_t>(mesh.positions.size());
  const auto first = static_cast<std::uint32_t>(mesh.triangles.size());
  std::vector<ViewRun> runs = runs_of(mesh);
  for (const ViewRun& run : runs_of(other))
    runs.push_back({first + run.first, run.count, run.view});
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  mesh.triangles.reserve(first + other.triangles.size());
  for (const Triangle& t : other.triangles)
    mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  if (!mesh.runs.empty() || !other.runs.empty()) take_runs(mesh, std::move(runs));
}

double surface_area_m2(const Mesh& mesh) {
  double twice = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) twice += length(mesh.area_normal(t));
  return twice / 2;
}

}  // namespace mr
