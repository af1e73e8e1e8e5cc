#include "mr/kit/hole_filling.h"

#include <algorithm>
#include <vector>

#include "mr/kit/pair_map.h"
#include "mr/kit/topology.h"

namespace mr::kit {
namespace {

constexpr std::size_t kMostCorners = 16;
constexpr std::uint32_t kNone = 0xFFFFFFFFu, kForked = 0xFFFFFFFEu;

std::uint64_t directed(std::uint32_t from, std::uint32_t to) {
  return static_cast<std::uint64_t>(from) << 32 | to;
}

/// The edges among border vertices, by their ends.
class BorderEdges {
 public:
  explicit BorderEdges(const Mesh& mesh) : edges_(1024), next_(mesh.positions.size(), kNone) {
    const std::vector<std::uint8_t> border = border_vertices(mesh);
    std::vector<std::uint32_t> half_edges;
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      const int count = border[a] + border[b] + border[c];
      if (count < 2) continue;
      for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h)
        if (border[edge_from(mesh, h)] && border[edge_to(mesh, h)]) half_edges.push_back(h);
    }
    for (const std::uint32_t h : half_edges)
      edges_.get_or_add(directed(edge_from(mesh, h), edge_to(mesh, h)), h);
    for (const std::uint32_t h : half_edges) {
      const std::uint32_t from = edge_from(mesh, h), to = edge_to(mesh, h);
      if (edges_.find(directed(to, from))) continue;
      starts_.push_back(from);
      next_[from] = next_[from] == kNone ? to : kForked;
    }
  }

  /// Where border edges start, in the mesh's order.
  const std::vector<std::uint32_t>& starts() const { return starts_; }
  /// The end of the border edge that starts at a vertex; kForked: several do.
  std::uint32_t next(std::uint32_t vertex) const { return next_[vertex]; }
  bool has(std::uint32_t a, std::uint32_t b) const {
    return edges_.find(directed(a, b)) || edges_.find(directed(b, a));
  }
  void add(std::uint32_t from, std::uint32_t to) { edges_.get_or_add(directed(from, to), kNone); }
  void close(std::uint32_t vertex) { next_[vertex] = kNone; }

 private:
  PairMap edges_;
  std::vector<std::uint32_t> next_, starts_;
};

/// The corners of the hole with a border edge from `start`; empty: it cannot be filled.
std::vector<std::uint32_t> hole_at(const Mesh& mesh, const BorderEdges& edges, std::uint32_t start,
                                   double max_perimeter_m) {
  std::vector<std::uint32_t> corners{start};
  double around = 0;
  for (std::uint32_t v = start;;) {
    const std::uint32_t to = edges.next(v);
    if (to == kNone || to == kForked) return {};
    around += length(mesh.positions[to] - mesh.positions[v]);
    if (around > max_perimeter_m) return {};
    if (to == start) break;
    if (corners.size() == kMostCorners) return {};
    corners.push_back(v = to);
  }
  return corners;
}

/// Fills a hole by ear clipping, shortest diagonal first; empty: not possible. Border edges run
/// around the hole with the surface on their left.
std::vector<Triangle> filling(const Mesh& mesh, const BorderEdges& edges,
                              std::vector<std::uint32_t> corners) {
  std::vector<Triangle> out;
  const auto at = [&](std::size_t i) { return corners[i % corners.size()]; };
  while (corners.size() > 3) {
    std::size_t best = corners.size();
    float least = 0;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const float across = length(mesh.positions[at(i + 2)] - mesh.positions[at(i)]);
      if ((best == corners.size() || across < least) && !edges.has(at(i), at(i + 2)))
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
  BorderEdges edges(mesh);
  std::vector<std::vector<std::uint32_t>> holes;
  std::vector<std::uint8_t> at_hole(mesh.positions.size(), 0);
  for (const std::uint32_t start : edges.starts()) {
    auto corners = hole_at(mesh, edges, start, max_perimeter_m);
    if (corners.size() < 3) continue;
    for (const std::uint32_t v : corners) edges.close(v), at_hole[v] = 1;
    holes.push_back(std::move(corners));
  }
  if (holes.empty()) return;
  const std::vector<Vec3f> normals = normals_at(mesh, at_hole);
  bool any = false;
  for (const auto& corners : holes) {
    const std::vector<Triangle> patch = filling(mesh, edges, corners);
    const bool fits = !patch.empty() && std::ranges::all_of(patch, [&](const Triangle& t) {
      return dot(area_normal(mesh, t), normals[t[0]] + normals[t[1]] + normals[t[2]]) > 0;
    });
    if (!fits) continue;
    for (const Triangle& t : patch) {
      mesh.triangles.push_back(t);
      for (int i = 0; i < 3; ++i) edges.add(t[i], t[(i + 1) % 3]);
    }
    any = true;
  }
  if (any) clear_labels(mesh);
}

}  // namespace mr::kit
