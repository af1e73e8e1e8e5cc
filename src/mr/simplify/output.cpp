#include "mr/simplify/output.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::simplify {

namespace {

/// A triangle belongs to the lowest of its vertices.
bool owns(std::uint32_t v, const OppositeEdge& triangle) {
  return v < triangle.a && v < triangle.b;
}

/// Where each range's share begins in the output.
struct OutputOffsets {
  std::uint32_t vertices = 0, triangles = 0;
};

std::vector<OutputOffsets> share_out(const WorkingMesh& mesh, OutputOffsets& total) {
  std::vector<OutputOffsets> out(mesh.ranges());
  mesh.for_each_range([&](std::uint32_t range) {
    OutputOffsets share;
    for (std::uint32_t v = mesh.begin(range); v < mesh.end(range); ++v) {
      if (!mesh.rings.alive(v)) continue;
      ++share.vertices;
      mesh.rings.visit(v,
                       [&](const OppositeEdge& triangle) { share.triangles += owns(v, triangle); });
    }
    out[range] = share;
  });
  for (OutputOffsets& share : out) {
    total.vertices += std::exchange(share.vertices, total.vertices);
    total.triangles += std::exchange(share.triangles, total.triangles);
  }
  return out;
}

/// Sorts the triangles by view and names their chunks.
void sort_by_label(std::span<const std::uint32_t> of_triangle, std::span<const Label> labels,
                   bool with_chunks, bool with_sensors, Simplified& out) {
  std::vector<std::uint32_t> order(of_triangle.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto label = [&](std::uint32_t t) -> const Label& { return labels[of_triangle[t]]; };
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t s, std::uint32_t t) {
    return label(s).sensor < label(t).sensor;
  });
  const std::vector<Triangle> triangles = std::move(out.mesh.triangles);
  out.mesh.triangles.clear();
  std::vector<SensorId> sensors;
  for (const std::uint32_t t : order) {
    out.mesh.triangles.push_back(triangles[t]);
    sensors.push_back(label(t).sensor);
    if (with_chunks) out.chunks.push_back(label(t).chunk);
  }
  if (with_sensors) set_triangle_sensors(out.mesh, sensors);
}

}  // namespace

Simplified output(const WorkingMesh& mesh, std::span<const Label> labels, bool with_chunks,
                  bool with_sensors, std::vector<std::uint32_t>& index) {
  OutputOffsets total;
  const std::vector<OutputOffsets> shares = share_out(mesh, total);
  Simplified out;
  out.mesh.positions.resize(total.vertices), out.mesh.triangles.resize(total.triangles);
  index.resize(mesh.vertices());
  out.errors_m.resize(total.vertices);
  mesh.for_each_range([&](std::uint32_t range) {
    std::uint32_t to = shares[range].vertices;
    for (std::uint32_t v = mesh.begin(range); v < mesh.end(range); ++v) {
      if (!mesh.rings.alive(v)) continue;
      const VertexPosition place = mesh.places[v];
      out.mesh.positions[to] = place.at, index[v] = to;
      if (place.error > 0) out.errors_m[to] = std::sqrt(place.error / mesh.quadrics[v].weight);
      ++to;
    }
  });
  std::vector<std::uint32_t> of_triangle(labels.empty() ? 0 : total.triangles);
  mesh.for_each_range([&](std::uint32_t range) {
    std::uint32_t to = shares[range].triangles;
    for (std::uint32_t v = mesh.begin(range); v < mesh.end(range); ++v) {
      if (!mesh.rings.alive(v)) continue;
      mesh.rings.visit(v, [&](const OppositeEdge& triangle) {
        if (!owns(v, triangle)) return;
        if (!labels.empty()) of_triangle[to] = triangle.label;
        out.mesh.triangles[to++] = {index[v], index[triangle.a], index[triangle.b]};
      });
    }
  });
  if (!out.errors_m.empty()) out.error_m = std::ranges::max(out.errors_m);
  if (!labels.empty()) sort_by_label(of_triangle, labels, with_chunks, with_sensors, out);
  return out;
}

}  // namespace mr::simplify
