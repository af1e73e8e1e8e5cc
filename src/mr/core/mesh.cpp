#include "mr/core/mesh.h"

#include <algorithm>
#include <utility>

#include "mr/core/assert.h"

namespace mr {

namespace {

template <typename Id>
constexpr Id kNone{0xFFFFFFFFu};

/// A mesh's runs, also when it is not labelled yet.
template <typename Id>
std::vector<Run<Id>> whole_runs(const Mesh& mesh, const std::vector<Run<Id>>& runs) {
  if (!runs.empty() || mesh.empty()) return runs;
  return {{0, static_cast<std::uint32_t>(mesh.triangles.size()), kNone<Id>}};
}

/// Sorts the triangles and the runs, which cover them in any order of labels, by label; stable.
template <typename Id>
std::vector<Run<Id>> sort_by_label(Mesh& mesh, std::vector<Run<Id>> runs) {
  std::ranges::stable_sort(runs, {}, &Run<Id>::id);
  std::vector<Run<Id>> out;
  std::vector<Triangle> sorted;
  sorted.reserve(mesh.triangles.size());
  for (const Run<Id>& run : runs) {
    if (out.empty() || out.back().id != run.id)
      out.push_back({static_cast<std::uint32_t>(sorted.size()), 0, run.id});
    out.back().count += run.count;
    const auto begin = mesh.triangles.begin() + run.first;
    sorted.insert(sorted.end(), begin, begin + run.count);
  }
  mesh.triangles = std::move(sorted);
  return out;
}

template <typename Id>
std::vector<Id> labels_of(const Mesh& mesh, const std::vector<Run<Id>>& runs) {
  std::vector<Id> out(mesh.triangles.size(), kNone<Id>);
  for (const Run<Id>& run : runs) {
    MR_ASSERT(run.first + run.count <= out.size());
    std::fill_n(out.begin() + run.first, run.count, run.id);
  }
  return out;
}

template <typename Id>
std::vector<Run<Id>> sort_by_labels(Mesh& mesh, const std::vector<Id>& labels) {
  MR_ASSERT(labels.size() == mesh.triangles.size());
  std::vector<Run<Id>> runs;
  for (std::uint32_t t = 0; t < labels.size(); ++t) {
    if (runs.empty() || runs.back().id != labels[t]) runs.push_back({t, 0, labels[t]});
    ++runs.back().count;
  }
  return sort_by_label(mesh, std::move(runs));
}

/// Both meshes' runs one after the other: the second's triangles follow `first` others.
template <typename Id>
std::vector<Run<Id>> both_runs(const Mesh& mesh, const Mesh& other,
                               std::vector<Run<Id>> Mesh::*runs) {
  std::vector<Run<Id>> out = whole_runs(mesh, mesh.*runs);
  const auto first = static_cast<std::uint32_t>(mesh.triangles.size());
  for (const Run<Id>& run : whole_runs(other, other.*runs))
    out.push_back({first + run.first, run.count, run.id});
  return out;
}

}  // namespace

std::vector<SensorId> triangle_sensors(const Mesh& mesh) { return labels_of(mesh, mesh.sensors); }
std::vector<ViewId> triangle_views(const Mesh& mesh) { return labels_of(mesh, mesh.views); }

void set_triangle_sensors(Mesh& mesh, const std::vector<SensorId>& sensors) {
  mesh.sensors = sort_by_labels(mesh, sensors);
  mesh.views.clear();
}
void set_triangle_views(Mesh& mesh, const std::vector<ViewId>& views) {
  mesh.views = sort_by_labels(mesh, views);
  mesh.sensors.clear();
}

void set_sensor(Mesh& mesh, SensorId sensor) {
  clear_labels(mesh);
  if (!mesh.empty())
    mesh.sensors = {{0, static_cast<std::uint32_t>(mesh.triangles.size()), sensor}};
}
void set_view(Mesh& mesh, ViewId view) {
  clear_labels(mesh);
  if (!mesh.empty()) mesh.views = {{0, static_cast<std::uint32_t>(mesh.triangles.size()), view}};
}
void clear_labels(Mesh& mesh) {
  mesh.sensors.clear();
  mesh.views.clear();
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
  const auto select_runs = [&](const auto& runs, auto& kept) {
    for (const auto& run : runs) {
      const auto first = static_cast<std::uint32_t>(out.triangles.size());
      select(run.first, run.first + run.count);
      const auto count = static_cast<std::uint32_t>(out.triangles.size()) - first;
      if (count > 0) kept.push_back({first, count, run.id});
    }
  };
  MR_ASSERT(mesh.sensors.empty() || mesh.views.empty());
  if (mesh.sensors.empty() && mesh.views.empty())
    select(0, static_cast<std::uint32_t>(keep.size()));
  select_runs(mesh.sensors, out.sensors);
  select_runs(mesh.views, out.views);
  return out;
}

void append(Mesh& mesh, const Mesh& other) {
  const bool by_sensor = !mesh.sensors.empty() || !other.sensors.empty();
  const bool by_view = !mesh.views.empty() || !other.views.empty();
  auto sensors = both_runs(mesh, other, &Mesh::sensors);
  auto views = both_runs(mesh, other, &Mesh::views);
  const auto base = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  mesh.triangles.reserve(mesh.triangles.size() + other.triangles.size());
  for (const Triangle& t : other.triangles)
    mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  clear_labels(mesh);
  if (by_view)
    mesh.views = sort_by_label(mesh, std::move(views));
  else if (by_sensor)
    mesh.sensors = sort_by_label(mesh, std::move(sensors));
}

double surface_area_m2(const Mesh& mesh) {
  double twice = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) twice += length(mesh.area_normal(t));
  return twice / 2;
}

}  // namespace mr
