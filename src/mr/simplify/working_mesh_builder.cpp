#include "mr/simplify/working_mesh_builder.h"
#include "mr/kit/float4.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::simplify {

namespace {

// Weight of the planes that preserve borders and creases, per edge length squared.
constexpr float kBorderWeight = 5;
constexpr float kTipWeight = 3;        // of a border's sharp tips, relative to its planes
constexpr std::size_t kBatch = 32768;  // triangles that are assigned at once

/// A triangle's plane through each of its corners, weighted by area: A of a Quadric and the weight.
struct Plane {
  kit::Float4 first, second;  // xx xy xz yy, yz zz weight area

  Plane(Vec3f a, Vec3f b, Vec3f c) {
    const Vec3f normal = cross(b - a, c - a);  // twice the area long
    const float square = dot(normal, normal);
    const float scale = square > 0 ? 0.5f / std::sqrt(square) : 0;
    const Vec3f m = normal * scale;
    const float area = square * scale;
    first = kit::Float4{normal.x * m.x, normal.x * m.y, normal.x * m.z, normal.y * m.y};
    second = kit::Float4{normal.y * m.z, normal.z * m.z, area, area};
  }
  void add_to(Quadric& quadric) const {
    kit::store4(kit::load4<kit::Float4>(&quadric.xx) + first, &quadric.xx);
    kit::store4(kit::load4<kit::Float4>(&quadric.yz) + second, &quadric.yz);
  }
};

/// Adds the plane along an edge of the vertex, perpendicular to the surface.
void add_wall(Vec3f edge, Vec3f normal, Quadric& quadric) {
  quadric.add_plane(normalized(cross(edge, normal)), kBorderWeight * dot(edge, edge));
}

/// Keeps the tip of a thin spike of the border: both its sides pass near its root, so without this
/// collapsing the spike would cost nothing.
void add_tip(Vec3f on, Vec3f back, Quadric& quadric) {
  const float sharp = dot(on, back);
  if (sharp > 0) quadric.add_point(kTipWeight * kBorderWeight * sharp);
}

void constrain_border(const Neighbourhood& near, Quadric& quadric) {
  const std::uint32_t last = near.size() - 1;
  const Vec3f on = near.arm(0), back = near.arm(last);
  add_wall(on, cross(on, near.arm(1)), quadric);
  add_wall(back, cross(near.arm(last - 1), back), quadric);
  add_tip(on, back, quadric);
}

/// Finds the indices in the ring where the label changes; true: exactly two, in a closed ring.
bool find_crease(const VertexRings& rings, std::uint32_t v, std::uint32_t (&at)[2],
                 std::uint32_t& count) {
  const VertexRings::Line& labels = rings.labels(v);
  const std::uint32_t size = rings.size(v), open = rings.is_open(v);
  count = 0;
  for (std::uint32_t i = open; i + open < size; ++i)
    if (labels[i] != labels[i > 0 ? i - 1 : size - 1]) {
      if (count < 2) at[count] = i;
      ++count;
    }
  return count == 2 && !open;
}

void constrain_crease(const Neighbourhood& near, const std::uint32_t (&at)[2], Quadric& quadric) {
  for (const std::uint32_t i : at) {
    const Vec3f edge = near.arm(i);
    const Vec3f next = near.arm(i + 1 < near.size() ? i + 1 : 0);
    const Vec3f before = near.arm(i > 0 ? i - 1 : near.size() - 1);
    add_wall(edge, cross(edge, next) + cross(before, edge), quadric);
  }
  add_tip(near.arm(at[0]), near.arm(at[1]), quadric);
}

/// Finds the kind of vertex v and adds the planes that keep its border or crease in place.
void prepare(std::uint32_t v, Neighbourhood& near, WorkingMesh& mesh) {
  const VertexRings& rings = mesh.rings;
  Quadric& quadric = mesh.quadrics[v];
  const bool open = rings.is_open(v);
  mesh.kinds[v] = open ? VertexKind::border : VertexKind::inner;
  if (!open && !rings.has_labels()) return;
  near.load(rings, mesh.places.data(), v);
  if (open) constrain_border(near, quadric);
  if (!rings.has_labels()) return;
  std::uint32_t at[2], count = 0;
  const bool crease = find_crease(rings, v, at, count);
  if (crease) constrain_crease(near, at, quadric);
  if (count > 0) mesh.kinds[v] = crease ? VertexKind::crease : VertexKind::fixed;
}

}  // namespace

/// Lists the triangles of each range of vertices, in order. Those that name a vertex twice are left
/// out.
void WorkingMeshBuilder::assign_triangles(const Mesh& mesh, std::uint32_t ranges) {
  const std::size_t total = mesh.triangles.size(), batches = (total + kBatch - 1) / kBatch;
  std::vector<std::uint32_t> at(batches * ranges, 0);
  const auto each_batch = [&](const auto& put) {
    parallel_for(batches, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t batch = begin; batch < end; ++batch)
        for (std::size_t t = batch * kBatch; t < std::min(total, (batch + 1) * kBatch); ++t) {
          const auto& [a, b, c] = mesh.triangles[t];
          const std::uint32_t ra = a / WorkingMesh::kRange, rb = b / WorkingMesh::kRange,
                              rc = c / WorkingMesh::kRange;
          if (a == b || b == c || c == a) continue;
          put(at[batch * ranges + ra], t);
          if (rb != ra) put(at[batch * ranges + rb], t);
          if (rc != ra && rc != rb) put(at[batch * ranges + rc], t);
        }
    });
  };
  each_batch([](std::uint32_t& count, std::size_t) { ++count; });
  first_.resize(ranges + 1);
  std::uint32_t sum = 0;
  for (std::uint32_t range = 0; range < ranges; ++range) {
    first_[range] = sum;
    for (std::size_t batch = 0; batch < batches; ++batch)
      sum += std::exchange(at[batch * ranges + range], sum);
  }
  first_[ranges] = sum;
  list_.resize(sum);
  each_batch(
      [&](std::uint32_t& to, std::size_t t) { list_[to++] = static_cast<std::uint32_t>(t); });
}

/// Assigns the vertices of a range their positions and triangles. Returns how many triangles begin
/// in the range.
std::size_t WorkingMeshBuilder::gather(const Mesh& mesh, std::span<const std::uint32_t> labels,
                                       std::uint32_t range, std::vector<OverflowTriangle>& refused,
                                       WorkingMesh& out) const {
  const std::uint32_t begin = out.begin(range), size = out.end(range) - begin;
  for (std::uint32_t v = begin; v < begin + size; ++v) {
    out.rings.clear(v);
    out.spans[v] = 0, out.quadrics[v] = {};
  }
  std::size_t count = 0;
  for (std::uint32_t i = first_[range]; i < first_[range + 1]; ++i) {
    const auto [a, b, c] = mesh.triangles[list_[i]];
    const std::uint32_t label = labels.empty() ? 0 : labels[list_[i]];
    const bool spans = a - begin >= size || b - begin >= size || c - begin >= size;
    count += a - begin < size;
    const Plane plane(out.places[a].at, out.places[b].at, out.places[c].at);
    const auto add = [&](std::uint32_t v, const OppositeEdge& triangle) {
      plane.add_to(out.quadrics[v]);
      if (!out.rings.add(v, triangle)) refused.push_back({v, triangle});
    };
    const auto add_spanning = [&](std::uint32_t v, const OppositeEdge& triangle) {
      if (v - begin >= size) return;
      out.spans[v] = 1;
      add(v, triangle);
    };
    if (spans)
      add_spanning(a, {b, c, label}), add_spanning(b, {c, a, label}),
          add_spanning(c, {a, b, label});
    else
      add(a, {b, c, label}), add(b, {c, a, label}), add(c, {a, b, label});
  }
  return count;
}

/// Makes rings of the triangles of a range's vertices, and sums up their planes.
void WorkingMeshBuilder::finish(std::uint32_t range, std::span<const float> weights,
                                std::vector<OverflowTriangle>& refused,
                                std::vector<ComplexVertex>& complex, WorkingMesh& out) {
  std::stable_sort(refused.begin(), refused.end(),
                   [](const OverflowTriangle& p, const OverflowTriangle& q) { return p.v < q.v; });
  auto next = refused.begin();
  std::vector<OppositeEdge> more, all;
  Neighbourhood near;
  for (std::uint32_t v = out.begin(range); v < out.end(range); ++v) {
    out.next[v] = kNever, out.kinds[v] = VertexKind::fixed;
    if (!out.rings.alive(v)) continue;
    more.clear();
    for (; next != refused.end() && next->v == v; ++next) more.push_back(next->triangle);
    if (out.rings.close(v, more, all)) {
      prepare(v, near, out);
      if (!weights.empty()) out.quadrics[v] = out.quadrics[v].scaled(weights[v]);
      if (out.kinds[v] != VertexKind::fixed) out.next[v] = 0;
    } else {
      complex.push_back({v, std::exchange(all, {})});
    }
  }
}

void WorkingMeshBuilder::run(const Mesh& mesh, std::span<const std::uint32_t> labels,
                             std::span<const float> weights, WorkingMesh& out) {
  const std::size_t vertices = mesh.positions.size();
  out.resize(vertices, !labels.empty());
  const std::uint32_t ranges = out.ranges();
  out.for_each_range([&](std::uint32_t range) {
    for (std::uint32_t v = out.begin(range); v < out.end(range); ++v)
      out.places[v] = {mesh.positions[v], 0};
  });
  assign_triangles(mesh, ranges);
  std::vector<std::size_t> triangles(ranges);
  std::vector<std::vector<ComplexVertex>> complex(ranges);
  parallel_for(ranges, 1, [&](std::size_t begin, std::size_t end) {
    std::vector<OverflowTriangle> refused;
    for (auto range = static_cast<std::uint32_t>(begin); range < end; ++range) {
      refused.clear();
      triangles[range] = gather(mesh, labels, range, refused, out);
      finish(range, weights, refused, complex[range], out);
    }
  });
  out.triangles = std::accumulate(triangles.begin(), triangles.end(), std::size_t{0});
  for (std::vector<ComplexVertex>& found : complex)
    for (ComplexVertex& one : found) out.rings.set_complex(one.v, std::move(one.triangles));
}

}  // namespace mr::simplify
