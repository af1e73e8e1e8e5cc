#include "mr/kit/borders.h"

#include <utility>

#include "mr/kit/topology.h"

namespace mr::kit {
namespace {

constexpr std::uint32_t kNoHalfEdge = 0xFFFFFFFFu, kMany = 0xFFFFFFFEu, kNowhere = 0xFFFFFFFFu;

std::uint32_t next_in_triangle(std::uint32_t half_edge) {
  return half_edge % 3 == 2 ? half_edge - 2 : half_edge + 1;
}

/// Divides a walk around a border into loops without a vertex twice.
class LoopSplitter {
 public:
  explicit LoopSplitter(std::size_t vertices) : place_(vertices, kNowhere) {}

  void split(const std::vector<std::uint32_t>& walk, std::vector<BorderLoop>& out) {
    std::vector<std::uint32_t> open;  // vertices of loops that are not closed yet
    for (const std::uint32_t v : walk) {
      if (place_[v] != kNowhere) {
        const auto begin = open.begin() + place_[v];
        if (open.end() - begin >= 3) out.emplace_back(begin, open.end());
        for (auto i = begin; i != open.end(); ++i) place_[*i] = kNowhere;
        open.erase(begin, open.end());
      }
      place_[v] = static_cast<std::uint32_t>(open.size());
      open.push_back(v);
    }
    for (const std::uint32_t v : open) place_[v] = kNowhere;
    if (open.size() >= 3) out.push_back(std::move(open));
  }

 private:
  std::vector<std::uint32_t> place_;  // [V] in `open`
};

}  // namespace

Borders::Borders(const Mesh& mesh) {
  std::vector<std::uint32_t> starts;
  find_half_edges(mesh, starts);
  if (starts.empty()) return;
  LoopSplitter splitter(mesh.positions.size());
  PairMap seen(starts.size());
  std::vector<std::uint32_t> walk;
  for (const std::uint32_t start : starts) {
    walk.clear();
    std::uint32_t e = start;
    for (; e != kNoHalfEdge && !seen.find(e); e = next_on_border(mesh, e)) {
      seen.get_or_add(e, 0);
      walk.push_back(edge_from(mesh, e));
    }
    if (e == start && !walk.empty()) splitter.split(walk, loops_);
  }
}

/// `starts`: the edges with one triangle.
void Borders::find_half_edges(const Mesh& mesh, std::vector<std::uint32_t>& starts) {
  const std::vector<std::uint8_t> border = border_vertices(mesh);
  std::vector<std::uint32_t> between;  // ends of borders
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    if (!(border[a] | border[b] | border[c])) continue;
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) {
      const std::uint32_t from = edge_from(mesh, h), to = edge_to(mesh, h);
      if (!(border[from] | border[to])) continue;
      if (std::uint32_t& known = half_edges_.get_or_add(key(from, to), h); known != h)
        known = kMany;
      if (border[from] & border[to]) between.push_back(h);
    }
  }
  for (const std::uint32_t h : between) {
    const std::uint32_t from = edge_from(mesh, h), to = edge_to(mesh, h);
    if (!half_edges_.find(key(to, from)) && *half_edges_.find(key(from, to)) == h)
      starts.push_back(h);
  }
}

/// The border edge that follows another one around its triangles; kNoHalfEdge: an edge there is not
/// manifold.
std::uint32_t Borders::next_on_border(const Mesh& mesh, std::uint32_t half_edge) const {
  const std::uint32_t first = next_in_triangle(half_edge);
  std::uint32_t e = first;
  for (;;) {
    const std::uint32_t from = edge_from(mesh, e), to = edge_to(mesh, e);
    if (*half_edges_.find(key(from, to)) == kMany) return kNoHalfEdge;
    const std::uint32_t* const twin = half_edges_.find(key(to, from));
    if (!twin) return e;
    if (*twin == kMany) return kNoHalfEdge;
    e = next_in_triangle(*twin);
    if (e == first) return kNoHalfEdge;
  }
}

}  // namespace mr::kit
