#include "mr/merge/seam/border.h"

#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

std::uint32_t before(std::uint32_t half_edge) {
  return half_edge % 3 == 0 ? half_edge + 2 : half_edge - 1;
}

/// Finds the border. Every border half-edge starts a fan of triangles around its vertex; only one
/// of them keeps the vertex.
Joined split_fans(const Mesh& mesh, std::uint32_t part) {
  Joined out{{mesh.positions, mesh.triangles, {}, {}}, triangle_sensors(mesh), {}, {}};
  const kit::EdgeTable edges = kit::edge_table(mesh);
  std::vector<std::uint8_t> taken(mesh.positions.size(), 0);
  for (std::uint32_t h = 0; h < edges.twin.size(); ++h) {
    if (edges.twin[h] != kit::kNoTwin) continue;
    out.came_apart |= edges.uses[h] > 1;
    out.border.push_back(h);
    const std::uint32_t v = kit::edge_from(mesh, h);
    if (std::exchange(taken[v], 1) == 0) continue;
    const auto fresh = static_cast<std::uint32_t>(out.mesh.positions.size());
    out.mesh.positions.push_back(mesh.positions[v]);
    for (std::uint32_t corner = h; corner != kit::kNoTwin; corner = edges.twin[before(corner)])
      out.mesh.triangles[corner / 3][corner % 3] = fresh;
  }
  out.part.assign(out.mesh.positions.size(), part);
  return out;
}

}  // namespace

Joined join_parts(std::span<const Mesh> parts) {
  std::vector<Joined> split(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      split[i] = split_fans(parts[i], static_cast<std::uint32_t>(i));
  });
  Joined out;
  for (const Joined& one : split) {
    const auto base = static_cast<std::uint32_t>(3 * out.mesh.triangles.size());
    for (const std::uint32_t h : one.border) out.border.push_back(base + h);
    append(out.mesh, one.mesh);
    out.sensor.insert(out.sensor.end(), one.sensor.begin(), one.sensor.end());
    out.part.insert(out.part.end(), one.part.begin(), one.part.end());
    out.came_apart |= one.came_apart;
  }
  return out;
}

}  // namespace mr::merge
