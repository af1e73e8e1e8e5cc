#include "mr/kit/topology.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <span>
#include <unordered_set>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/pair_map.h"

namespace mr::kit {
namespace {

constexpr std::size_t kGrain = 8192;  // vertices per parallel task

std::uint64_t edge_key(std::uint32_t a, std::uint32_t b) {
  return (static_cast<std::uint64_t>(std::min(a, b)) << 32) | std::max(a, b);
}

/// A half-edge at the smaller of its two vertices.
struct EdgeUse {
  std::uint32_t other;  ///< the larger one
  std::uint32_t half_edge;
};

/// Half-edges grouped by the smaller of their two vertices: those of vertex v are
/// items[start[v]] .. items[start[v + 1]], sorted by the other vertex, so edges are neighbours.
struct EdgesByVertex {
  std::vector<std::uint32_t> start;
  std::vector<EdgeUse> items;
};

/// Stable. A vertex has a handful of edges, so mostly by insertion.
void sort_by_other(std::span<EdgeUse> uses) {
  const auto before = [](const EdgeUse& a, const EdgeUse& b) { return a.other < b.other; };
  constexpr std::size_t kHandful = 32;
  if (uses.size() > kHandful) return std::stable_sort(uses.begin(), uses.end(), before);
  for (std::size_t i = 1; i < uses.size(); ++i) {
    const EdgeUse use = uses[i];
    std::size_t at = i;
    for (; at > 0 && before(use, uses[at - 1]); --at) uses[at] = uses[at - 1];
    uses[at] = use;
  }
}

EdgesByVertex edges_by_lower_vertex(const Mesh& mesh) {
  EdgesByVertex out;
  out.start.assign(mesh.positions.size() + 1, 0);
  for (const auto& [a, b, c] : mesh.triangles)
    ++out.start[std::min(a, b) + 1], ++out.start[std::min(b, c) + 1],
        ++out.start[std::min(c, a) + 1];
  std::partial_sum(out.start.begin(), out.start.end(), out.start.begin());
  out.items.resize(mesh.triangles.size() * 3);
  std::vector<std::uint32_t> next(out.start.begin(), out.start.end() - 1);
  std::uint32_t h = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    out.items[next[std::min(a, b)]++] = {std::max(a, b), h++};
    out.items[next[std::min(b, c)]++] = {std::max(b, c), h++};
    out.items[next[std::min(c, a)]++] = {std::max(c, a), h++};
  }
  parallel_for(mesh.positions.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      sort_by_other(std::span(out.items).subspan(out.start[v], out.start[v + 1] - out.start[v]));
  });
  return out;
}

}  // namespace

std::vector<std::uint8_t> border_vertices(const Mesh& mesh) {
  // Around an inner vertex, each neighbour is once the next and once the previous corner of a
  // triangle, so the neighbours' hash values cancel out.
  const auto stands_for = [](std::uint32_t v) {
    std::uint64_t h = (v + 1) * 0x9E3779B97F4A7C15ull;
    h ^= h >> 32;
    return h * 0xBF58476D1CE4E5B9ull;
  };
  std::vector<std::uint64_t> sum(mesh.positions.size(), 0);
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::uint64_t ha = stands_for(a), hb = stands_for(b), hc = stands_for(c);
    sum[a] += hb - hc, sum[b] += hc - ha, sum[c] += ha - hb;
  }
  std::vector<std::uint8_t> out(sum.size());
  for (std::size_t v = 0; v < out.size(); ++v) out[v] = sum[v] != 0;
  return out;
}

EdgeTable edge_table(const Mesh& mesh) {
  const EdgesByVertex edges = edges_by_lower_vertex(mesh);
  EdgeTable table;
  table.twin.assign(edges.items.size(), kNoTwin);
  table.uses.assign(edges.items.size(), 0);
  const auto look_at = [&](std::size_t v) {
    for (std::uint32_t first = edges.start[v], end; first < edges.start[v + 1]; first = end) {
      for (end = first + 1;
           end < edges.start[v + 1] && edges.items[first].other == edges.items[end].other;)
        ++end;
      for (std::uint32_t i = first; i < end; ++i)
        table.uses[edges.items[i].half_edge] =
            static_cast<std::uint8_t>(std::min<std::uint32_t>(end - first, 255));
      if (end - first != 2) continue;
      const std::uint32_t a = edges.items[first].half_edge, b = edges.items[end - 1].half_edge;
      if (edge_from(mesh, a) == edge_to(mesh, b)) table.twin[a] = b, table.twin[b] = a;
    }
  };
  parallel_for(mesh.positions.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) look_at(v);
  });
  return table;
}

std::size_t count_nonmanifold_edges(const Mesh& mesh) {
  double edges = 0;
  for (const std::uint8_t uses : edge_table(mesh).uses)
    if (uses > 2) edges += 1.0 / uses;
  return static_cast<std::size_t>(edges + 0.5);
}

std::size_t count_boundary_edges(const Mesh& mesh) {
  const EdgeTable table = edge_table(mesh);
  return static_cast<std::size_t>(std::count(table.uses.begin(), table.uses.end(), 1));
}

namespace {

/// For every key the place of the first that equals it.
std::vector<std::uint32_t> first_alike(const std::vector<Vec3i>& keys) {
  constexpr std::uint32_t kFree = 0xFFFFFFFFu;
  std::vector<std::uint32_t> slots(std::bit_ceil(2 * keys.size() + 1), kFree), out(keys.size());
  for (std::uint32_t i = 0; i < keys.size(); ++i) {
    std::size_t at = hash_cell(keys[i]) & (slots.size() - 1);
    while (slots[at] != kFree && keys[slots[at]] != keys[i]) at = (at + 1) & (slots.size() - 1);
    if (slots[at] == kFree) slots[at] = i;
    out[i] = slots[at];
  }
  return out;
}

/// The same triangle with its smallest index first.
Vec3i canonical(Triangle t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return {static_cast<std::int32_t>(t[0]), static_cast<std::int32_t>(t[1]),
          static_cast<std::int32_t>(t[2])};
}

}  // namespace

std::vector<std::uint32_t> same_place(const std::vector<Vec3f>& positions) {
  std::vector<Vec3i> bits(positions.size());
  std::ranges::transform(positions, bits.begin(), [](Vec3f p) {
    // + 0 turns -0 into 0: they are the same place.
    return Vec3i{std::bit_cast<std::int32_t>(p.x + 0.0f), std::bit_cast<std::int32_t>(p.y + 0.0f),
                 std::bit_cast<std::int32_t>(p.z + 0.0f)};
  });
  return first_alike(bits);
}

Mesh weld(const Mesh& mesh) {
  const std::vector<std::uint32_t> representative = same_place(mesh.positions);
  Mesh joined = mesh;
  std::vector<Vec3i> names;
  names.reserve(joined.triangles.size());
  for (Triangle& t : joined.triangles) {
    for (std::uint32_t& v : t) v = representative[v];
    names.push_back(canonical(t));
  }
  const std::vector<std::uint32_t> first = first_alike(names);
  std::vector<std::uint8_t> keep(first.size());
  for (std::uint32_t i = 0; i < keep.size(); ++i) {
    const auto [a, b, c] = joined.triangles[i];
    keep[i] = a != b && b != c && c != a && first[i] == i;
  }
  return select_triangles(joined, keep);
}

Mesh without_nonmanifold_edges(const Mesh& mesh) {
  const EdgeTable table = edge_table(mesh);
  std::vector<std::uint32_t> suspects;  // triangles at such an edge, largest first
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h)
      if (table.uses[h] > 1 && table.twin[h] == kNoTwin &&
          (suspects.empty() || suspects.back() != t))
        suspects.push_back(t);
  if (suspects.empty()) return mesh;
  std::stable_sort(suspects.begin(), suspects.end(), [&](std::uint32_t a, std::uint32_t b) {
    return length(mesh.area_normal(a)) > length(mesh.area_normal(b));
  });

  std::vector<std::uint8_t> keep(mesh.triangles.size(), 1);
  for (const std::uint32_t t : suspects) keep[t] = 0;
  std::vector<std::uint8_t> suspect(mesh.positions.size(), 0);  // vertices
  for (const std::uint32_t t : suspects)
    for (const std::uint32_t v : mesh.triangles[t]) suspect[v] = 1;
  std::unordered_set<std::uint64_t> taken;  // directed edges of suspects, one triangle each
  const auto directed = [&](std::uint32_t h) {
    return static_cast<std::uint64_t>(edge_from(mesh, h)) << 32 | edge_to(mesh, h);
  };
  for (std::uint32_t h = 0; h < table.twin.size(); ++h)
    if (keep[h / 3] && suspect[edge_from(mesh, h)] && suspect[edge_to(mesh, h)])
      taken.insert(directed(h));
  for (const std::uint32_t t : suspects) {
    if (taken.contains(directed(3 * t)) || taken.contains(directed(3 * t + 1)) ||
        taken.contains(directed(3 * t + 2)))
      continue;
    keep[t] = 1;
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) taken.insert(directed(h));
  }
  return select_triangles(mesh, keep);
}

Components components(const Mesh& mesh) {
  const EdgeTable table = edge_table(mesh);
  std::vector<std::uint32_t> root(mesh.triangles.size());
  std::iota(root.begin(), root.end(), 0u);
  const auto find = [&](std::uint32_t t) {
    while (root[t] != t) t = root[t] = root[root[t]];
    return t;
  };
  for (std::uint32_t h = 0; h < table.twin.size(); ++h) {
    if (table.twin[h] == kNoTwin || table.twin[h] < h) continue;
    const std::uint32_t a = find(h / 3), b = find(table.twin[h] / 3);
    root[std::max(a, b)] = std::min(a, b);
  }
  Components out;
  std::vector<std::uint32_t> number(mesh.triangles.size(), kNoTwin);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    std::uint32_t& n = number[find(t)];
    if (n == kNoTwin) {
      n = static_cast<std::uint32_t>(out.area_m2.size());
      out.area_m2.push_back(0);
    }
    out.of_triangle.push_back(n);
    out.area_m2[n] += 0.5 * length(mesh.area_normal(t));
  }
  return out;
}

VertexFans::VertexFans(const Mesh& mesh)
    : start(mesh.positions.size() + 2), triangle(3 * mesh.triangles.size()) {
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) ++start[v + 2];
  std::partial_sum(start.begin(), start.end(), start.begin());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t]) triangle[start[v + 1]++] = t;
  start.pop_back();
}

namespace {

/// [V] for each vertex the normalized sum of its triangles' values.
std::vector<Vec3f> normalized_sums(const VertexFans& fans, const std::vector<Vec3f>& of_triangle) {
  std::vector<Vec3f> out(fans.start.size() - 1);
  parallel_for(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      Vec3f sum;
      for (const std::uint32_t t : fans.at(static_cast<std::uint32_t>(v))) sum += of_triangle[t];
      out[v] = normalized(sum);
    }
  });
  return out;
}

std::vector<Vec3f> area_normals(const Mesh& mesh) {
  std::vector<Vec3f> out(mesh.triangles.size());
  parallel_for(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) out[t] = mesh.area_normal(t);
  });
  return out;
}

}  // namespace

std::vector<Vec3f> vertex_normals(const Mesh& mesh) {
  return normalized_sums(VertexFans(mesh), area_normals(mesh));
}

std::vector<Vec3f> smooth_normals(const Mesh& mesh, int rounds) {
  const VertexFans fans(mesh);
  std::vector<Vec3f> of_triangle = area_normals(mesh);
  std::vector<Vec3f> normals = normalized_sums(fans, of_triangle);
  for (int i = 0; i < rounds; ++i) {
    parallel_for(of_triangle.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        const auto& [a, b, c] = mesh.triangles[t];
        of_triangle[t] = normals[a] + normals[b] + normals[c];
      }
    });
    normals = normalized_sums(fans, of_triangle);
  }
  return normals;
}

namespace {

/// Cuts triangle `t` whose edge i has the midpoint m[i] (kNoTwin: not cut).
void cut_triangle(const Triangle& t, const std::array<std::uint32_t, 3>& m, const Mesh& mesh,
                  std::vector<Triangle>& out) {
  const auto is_cut = [&](int i) { return m[i] != kNoTwin; };
  const int cuts = is_cut(0) + is_cut(1) + is_cut(2);
  if (cuts == 0) {
    out.push_back(t);
  } else if (cuts == 1) {
    const int i = is_cut(0) ? 0 : is_cut(1) ? 1 : 2;
    const std::uint32_t a = t[i], b = t[(i + 1) % 3], c = t[(i + 2) % 3];
    out.push_back({a, m[i], c});
    out.push_back({m[i], b, c});
  } else if (cuts == 2) {
    const int i = !is_cut(0) ? 0 : !is_cut(1) ? 1 : 2;  // the edge that stays whole
    const std::uint32_t a = t[i], b = t[(i + 1) % 3], c = t[(i + 2) % 3];
    const std::uint32_t bc = m[(i + 1) % 3], ca = m[(i + 2) % 3];
    out.push_back({ca, bc, c});
    const auto span = [&](std::uint32_t u, std::uint32_t v) {
      return length(mesh.positions[u] - mesh.positions[v]);
    };
    if (span(a, bc) <= span(b, ca)) {  // the shorter diagonal of the remaining quadrilateral
      out.push_back({a, b, bc});
      out.push_back({a, bc, ca});
    } else {
      out.push_back({a, b, ca});
      out.push_back({b, bc, ca});
    }
  } else {
    out.push_back({t[0], m[0], m[2]});
    out.push_back({t[1], m[1], m[0]});
    out.push_back({t[2], m[2], m[1]});
    out.push_back({m[0], m[1], m[2]});
  }
}

}  // namespace

namespace {

/// The midpoints of the edges to be cut.
class Midpoints {
 public:
  /// Appends them to `positions`.
  Midpoints(const Mesh& mesh, const std::vector<std::uint8_t>& split, std::vector<Vec3f>& positions)
      : midpoint_(1024), at_cut_(mesh.positions.size()) {
    MR_ASSERT(split.size() == mesh.triangles.size() * 3);
    for (std::uint32_t h = 0; h < split.size(); ++h) {
      if (!split[h]) continue;
      const std::uint32_t a = edge_from(mesh, h), b = edge_to(mesh, h);
      const auto next = static_cast<std::uint32_t>(positions.size());
      if (midpoint_.get_or_add(edge_key(a, b), next) != next) continue;
      positions.push_back((positions[a] + positions[b]) * 0.5f);
      cut_edges.push_back({a, b});
      at_cut_[a] = at_cut_[b] = 1;
    }
  }

  /// Of a triangle's edges; kNoTwin: not cut.
  std::array<std::uint32_t, 3> of(const Triangle& t) const {
    std::array<std::uint32_t, 3> out{kNoTwin, kNoTwin, kNoTwin};
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      if (!at_cut_[a] || !at_cut_[b]) continue;
      if (const std::uint32_t* found = midpoint_.find(edge_key(a, b))) out[i] = *found;
    }
    return out;
  }

  std::vector<std::array<std::uint32_t, 2>> cut_edges;

 private:
  PairMap midpoint_;
  std::vector<std::uint8_t> at_cut_;  ///< [V] vertices at an end of a cut edge
};

}  // namespace

Refined refine(const Mesh& mesh, const std::vector<std::uint8_t>& split) {
  Refined out;
  out.mesh.positions = mesh.positions;
  Midpoints midpoints(mesh, split, out.mesh.positions);
  out.cut_edges = std::move(midpoints.cut_edges);
  out.mesh.triangles.reserve(mesh.triangles.size() + 2 * out.cut_edges.size());
  out.parent.reserve(out.mesh.triangles.capacity());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    cut_triangle(mesh.triangles[t], midpoints.of(mesh.triangles[t]), out.mesh, out.mesh.triangles);
    out.parent.resize(out.mesh.triangles.size(), t);
  }
  return out;
}

Cuts refine_in_place(Mesh& mesh, const std::vector<std::uint8_t>& split) {
  Cuts out;
  Midpoints midpoints(mesh, split, mesh.positions);
  out.cut_edges = std::move(midpoints.cut_edges);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  std::vector<Triangle> pieces;
  for (std::uint32_t t = 0; t < count; ++t) {
    const std::array<std::uint32_t, 3> middles = midpoints.of(mesh.triangles[t]);
    if (middles[0] == kNoTwin && middles[1] == kNoTwin && middles[2] == kNoTwin) continue;
    pieces.clear();
    cut_triangle(mesh.triangles[t], middles, mesh, pieces);
    mesh.triangles[t] = pieces.front();
    mesh.triangles.insert(mesh.triangles.end(), pieces.begin() + 1, pieces.end());
    out.changed.push_back(t), out.parent.resize(mesh.triangles.size() - count, t);
  }
  return out;
}

}  // namespace mr::kit
