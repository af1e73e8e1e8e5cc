#include "mr/merge/holes/border_loops.h"

#include <algorithm>
#include <utility>

#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

constexpr std::uint32_t kNoPlace = 0xFFFFFFFFu;

std::uint32_t next_in_triangle(std::uint32_t half_edge) {
  return half_edge % 3 == 2 ? half_edge - 2 : half_edge + 1;
}

/// The border edge that follows another one around its triangles; kNoPlace: an edge there is not
/// manifold.
std::uint32_t next_on_border(const kit::EdgeTable& edges, std::uint32_t half_edge) {
  std::uint32_t e = next_in_triangle(half_edge);
  while (edges.twin[e] != kit::kNoTwin) {
    e = next_in_triangle(edges.twin[e]);
    if (e == half_edge) return kNoPlace;
  }
  return edges.uses[e] == 1 ? e : kNoPlace;
}

/// Divides a walk around a border into loops without a vertex twice.
class LoopSplitter {
 public:
  explicit LoopSplitter(std::size_t vertices) : place_(vertices, kNoPlace) {}

  void split(const std::vector<std::uint32_t>& walk, std::vector<BorderLoop>& out) {
    std::vector<std::uint32_t> open;  // vertices of loops that are not closed yet
    for (const std::uint32_t v : walk) {
      if (place_[v] != kNoPlace) {
        const auto begin = open.begin() + place_[v];
        if (open.end() - begin >= 3) out.emplace_back(begin, open.end());
        for (auto i = begin; i != open.end(); ++i) place_[*i] = kNoPlace;
        open.erase(begin, open.end());
      }
      place_[v] = static_cast<std::uint32_t>(open.size());
      open.push_back(v);
    }
    for (const std::uint32_t v : open) place_[v] = kNoPlace;
    if (open.size() >= 3) out.push_back(std::move(open));
  }

 private:
  std::vector<std::uint32_t> place_;  // [V] in `open`
};

}  // namespace

std::vector<BorderLoop> border_loops(const Mesh& mesh) {
  const kit::EdgeTable edges = kit::edge_table(mesh);
  std::vector<std::uint8_t> seen(edges.uses.size(), 0);
  LoopSplitter splitter(mesh.positions.size());
  std::vector<BorderLoop> out;
  std::vector<std::uint32_t> walk;
  for (std::uint32_t start = 0; start < seen.size(); ++start) {
    if (edges.uses[start] != 1 || seen[start]) continue;
    walk.clear();
    std::uint32_t e = start;
    for (; e != kNoPlace && !seen[e]; e = next_on_border(edges, e)) {
      seen[e] = 1;
      walk.push_back(kit::edge_from(mesh, e));
    }
    if (e == start) splitter.split(walk, out);
  }
  return out;
}

}  // namespace mr::merge
