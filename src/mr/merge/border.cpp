#include "mr/merge/border.h"

#include <algorithm>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

/// The half-edges between border vertices, and which of them belong together.
struct BorderEdges {
  std::vector<std::uint32_t> half_edges;  ///< ascending
  std::vector<std::uint8_t> paired;       ///< the only one this way, and one the other way
};

BorderEdges edges_among(const Mesh& mesh, const std::vector<std::uint8_t>& at_border) {
  BorderEdges out;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    if (at_border[a] + at_border[b] + at_border[c] < 2) continue;
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h)
      if (at_border[kit::edge_from(mesh, h)] && at_border[kit::edge_to(mesh, h)])
        out.half_edges.push_back(h);
  }
  // The half-edges that start at a vertex, as a list.
  constexpr std::uint32_t kEnd = 0xFFFFFFFFu;
  std::vector<std::uint32_t> first(mesh.positions.size(), kEnd), next(out.half_edges.size()),
      to(out.half_edges.size());
  for (std::uint32_t i = 0; i < next.size(); ++i) {
    to[i] = kit::edge_to(mesh, out.half_edges[i]);
    next[i] = std::exchange(first[kit::edge_from(mesh, out.half_edges[i])], i);
  }
  const auto once = [&](std::uint32_t a, std::uint32_t b) {
    int count = 0;
    for (std::uint32_t i = first[a]; i != kEnd; i = next[i]) count += to[i] == b;
    return count == 1;
  };
  out.paired.resize(next.size());
  for (std::size_t i = 0; i < next.size(); ++i) {
    const std::uint32_t a = kit::edge_from(mesh, out.half_edges[i]);
    out.paired[i] = once(to[i], a) && once(a, to[i]);
  }
  return out;
}

/// Gives each fan of triangles at a border vertex a vertex of its own.
class FanSplitter {
 public:
  FanSplitter(Mesh& mesh, const std::vector<std::uint8_t>& at_border) : mesh_(mesh) {
    std::vector<std::uint32_t> first(mesh.positions.size() + 1, 0);
    for (const Triangle& t : mesh.triangles)
      for (const std::uint32_t v : t) first[v + 1] += at_border[v];
    for (std::size_t v = 0; v + 1 < first.size(); ++v) first[v + 1] += first[v];
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    std::vector<Corner> corners(first.back());
    for (std::uint32_t h = 0; h < mesh.triangles.size() * 3; ++h)
      if (const std::uint32_t v = kit::edge_from(mesh, h); at_border[v])
        corners[next[v]++] = {h, kit::edge_to(mesh, h), kit::edge_from(mesh, before(h))};
    for (std::size_t v = 0; v + 1 < first.size(); ++v)
      split(std::span(corners).subspan(first[v], first[v + 1] - first[v]));
  }

  /// The vertices that those at the end of the mesh are copies of.
  const std::vector<std::uint32_t>& copied() const { return copied_; }

 private:
  /// A triangle at the vertex: the half-edge that starts there, and the neighbours at its two ends.
  struct Corner {
    std::uint32_t half_edge = 0, next = 0, prev = 0;
  };

  static std::uint32_t before(std::uint32_t h) { return h - h % 3 + (h % 3 + 2) % 3; }

  void split(std::span<Corner> corners) {
    for (std::size_t left = 0; left < corners.size();) {
      std::size_t fan = left + 1;  // [left, fan): one fan, as far as known
      for (std::size_t i = left; i < fan; ++i)
        for (std::size_t k = fan; k < corners.size(); ++k)
          if (side_by_side(corners[i], corners[k], corners)) std::swap(corners[fan++], corners[k]);
      if (left > 0) {
        const auto fresh = static_cast<std::uint32_t>(mesh_.positions.size());
        copied_.push_back(kit::edge_from(mesh_, corners[left].half_edge));
        mesh_.positions.push_back(mesh_.positions[copied_.back()]);
        for (std::size_t i = left; i < fan; ++i)
          mesh_.triangles[corners[i].half_edge / 3][corners[i].half_edge % 3] = fresh;
      }
      left = fan;
    }
  }

  static bool side_by_side(const Corner& a, const Corner& b, std::span<const Corner> all) {
    return (a.next == b.prev && is_manifold(a.next, all)) ||
           (b.next == a.prev && is_manifold(b.next, all));
  }
  /// Whether the edge to a neighbour has one triangle on either side.
  static bool is_manifold(std::uint32_t neighbour, std::span<const Corner> all) {
    return std::ranges::count(all, neighbour, &Corner::next) == 1 &&
           std::ranges::count(all, neighbour, &Corner::prev) == 1;
  }

  Mesh& mesh_;
  std::vector<std::uint32_t> copied_;
};

}  // namespace

void split_fans(Joined& joined) {
  const std::vector<std::uint8_t> at_border = kit::border_vertices(joined.mesh);
  const BorderEdges edges = edges_among(joined.mesh, at_border);
  joined.border.clear();
  for (std::size_t i = 0; i < edges.half_edges.size(); ++i)
    if (!edges.paired[i]) joined.border.push_back(edges.half_edges[i]);
  const FanSplitter splitter(joined.mesh, at_border);
  for (const std::uint32_t v : splitter.copied()) joined.part.push_back(joined.part[v]);
}

Joined join_parts(std::span<const Mesh> parts) {
  std::vector<Joined> split(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      split[i].mesh = {parts[i].positions, parts[i].triangles, {}};
      split[i].part.resize(parts[i].positions.size());
      split_fans(split[i]);
    }
  });
  Joined out;
  for (std::uint32_t i = 0; i < split.size(); ++i) {
    const auto base = static_cast<std::uint32_t>(3 * out.mesh.triangles.size());
    for (const std::uint32_t h : split[i].border) out.border.push_back(base + h);
    append(out.mesh, split[i].mesh);
    out.part.resize(out.mesh.positions.size(), i);
  }
  return out;
}

std::vector<std::uint32_t> border_half_edges(const Mesh& mesh) {
  const BorderEdges edges = edges_among(mesh, kit::border_vertices(mesh));
  std::vector<std::uint32_t> out;
  for (std::size_t i = 0; i < edges.half_edges.size(); ++i)
    if (!edges.paired[i]) out.push_back(edges.half_edges[i]);
  return out;
}

}  // namespace mr::merge
