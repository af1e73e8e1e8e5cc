#include "mr/merge/front.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "mr/core/assert.h"
#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

constexpr double kAngleSlack = 1e-4;  // radians
constexpr float kFacing = 0.05f;      // cosine between a filling triangle and the surface around it

}  // namespace

Front::Front(const Mesh& mesh)
    : positions_(mesh.positions),
      normals_(kit::vertex_normals(mesh)),
      place_(kit::same_place(mesh.positions)) {
  const kit::EdgeTable table = kit::edge_table(mesh);
  corners_.resize(mesh.positions.size());
  std::vector<std::uint8_t> on_border(mesh.positions.size(), 0);
  for (std::uint32_t h = 0; h < table.twin.size(); ++h)
    if (table.twin[h] == kit::kNoTwin) {
      add_edge(kit::edge_from(mesh, h), kit::edge_to(mesh, h));
      on_border[place_[kit::edge_from(mesh, h)]] = on_border[place_[kit::edge_to(mesh, h)]] = 1;
    }
  for (std::uint32_t e = 0; e < edges_.size(); ++e) {
    MR_ASSERT(corners_[edges_[e].to].size() == 1);
    link(e, corners_[edges_[e].to].front());
  }
  for (std::uint32_t h = 0; h < table.twin.size(); ++h) {
    const std::uint32_t a = kit::edge_from(mesh, h), b = kit::edge_to(mesh, h);
    if (on_border[place_[a]] && on_border[place_[b]]) surface_.insert(directed(a, b));
  }
}

std::span<const std::uint32_t> Front::corners_at(std::uint32_t vertex) const {
  return corners_[vertex];
}

std::uint32_t Front::add_edge(std::uint32_t from, std::uint32_t to) {
  const auto e = static_cast<std::uint32_t>(edges_.size());
  edges_.push_back({from, to, e, e, true});
  corners_[from].push_back(e);
  border_[directed(from, to)] = e;
  return e;
}

void Front::retire(std::uint32_t e) {
  edges_[e].alive = false;
  const auto found = border_.find(directed(edges_[e].from, edges_[e].to));
  if (found != border_.end() && found->second == e) border_.erase(found);
  std::erase(corners_[edges_[e].from], e);
}

/// Angle from the direction to `reference` counter-clockwise to `other`, seen against the normal at
/// `vertex`; in [0, 2π).
double Front::angle(std::uint32_t vertex, std::uint32_t reference, std::uint32_t other) const {
  const Vec3d n = vec_cast<double>(normals_[vertex]);
  const Vec3d r = vec_cast<double>(at(reference) - at(vertex)),
              o = vec_cast<double>(at(other) - at(vertex));
  const double a = std::atan2(dot(n, cross(r, o)), dot(r, o) - dot(n, r) * dot(n, o));
  return a < 0 ? a + 2 * std::numbers::pi : a;
}

/// No third triangle: u → w and w → v must be free, and what lies behind them on the border.
bool Front::edges_are_free(std::uint32_t u, std::uint32_t v, std::uint32_t w) const {
  for (const auto& [from, to] : {std::pair(u, w), std::pair(w, v)}) {
    if (surface_.contains(directed(from, to))) return false;
    if (surface_.contains(directed(to, from)) && !border_.contains(directed(to, from)))
      return false;
  }
  return true;
}

bool Front::fits_as_ear(std::uint32_t e) const {
  const std::uint32_t u = edges_[e].from, v = edges_[e].to, w = edges_[ear_corner(e)].from;
  if (place_[w] == place_[u] || place_[w] == place_[v]) return false;
  const Vec3f across = cross(at(u) - at(v), at(w) - at(v));
  return dot(across, normals_[u] + normals_[v] + normals_[w]) > 0 && edges_are_free(u, v, w);
}

bool Front::fits(std::uint32_t e, std::uint32_t corner) const {
  const auto [u, v, after_e, before_e, alive] = edges_[e];
  const Edge& c = edges_[corner];
  const std::uint32_t w = c.from;
  if (!alive || !c.alive || place_[w] == place_[u] || place_[w] == place_[v]) return false;

  const Vec3f across = cross(at(u) - at(v), at(w) - at(v));
  const float size = length(across);
  if (size <= 1e-12f) return false;
  for (const std::uint32_t k : {u, v, w})
    if (dot(across, normals_[k]) < kFacing * size) return false;

  // Inside the gap's angle, counter-clockwise from the incoming to the outgoing border edge.
  const std::uint32_t x = edges_[before_e].from, y = edges_[after_e].to, a = edges_[c.prev].from,
                      b = c.to;
  const auto sector = [&](std::uint32_t vertex, std::uint32_t in, std::uint32_t out) {
    const double s = angle(vertex, in, out);
    return s < kAngleSlack ? 2 * std::numbers::pi : s;
  };
  const double at_u = x == w ? 0 : angle(u, x, w), at_v = y == w ? sector(v, u, y) : angle(v, u, w);
  if (at_u > sector(u, x, v) - kAngleSlack || at_v > sector(v, u, y) + kAngleSlack ||
      at_v < kAngleSlack)
    return false;
  const double gap = sector(w, a, b);
  const double to_v = a == v ? 0 : angle(w, a, v), to_u = b == u ? gap : angle(w, a, u);
  if (to_v >= to_u || to_u > gap + kAngleSlack) return false;

  return edges_are_free(u, v, w);
}

std::vector<std::uint32_t> Front::fill(std::uint32_t e, std::uint32_t corner) {
  const Edge old = edges_[e];
  const std::uint32_t w = edges_[corner].from, before_w = edges_[corner].prev;
  added_.push_back({old.to, old.from, w});
  surface_.insert(directed(old.to, old.from));
  surface_.insert(directed(old.from, w));
  surface_.insert(directed(w, old.to));

  const std::uint32_t in = add_edge(old.from, w), out = add_edge(w, old.to);
  link(old.prev, in);
  link(in, corner);
  link(before_w, out);
  link(out, old.next);
  retire(e);
  close(in);
  close(out);
  std::vector<std::uint32_t> fresh;
  for (const std::uint32_t f : {in, out})
    if (edges_[f].alive) fresh.push_back(f);
  return fresh;
}

void Front::close(std::uint32_t e) {
  if (!edges_[e].alive) return;
  const auto found = border_.find(directed(edges_[e].to, edges_[e].from));
  if (found == border_.end()) return;
  const std::uint32_t o = found->second;
  const Edge a = edges_[e], b = edges_[o];
  retire(e);
  retire(o);
  if (a.prev != o) link(a.prev, b.next);
  if (b.prev != e) link(b.prev, a.next);
}

std::optional<int> Front::loop_length(std::uint32_t e, int limit) const {
  int count = 1;
  for (std::uint32_t k = edges_[e].next; k != e; k = edges_[k].next)
    if (++count > limit) return std::nullopt;
  return count;
}

Mesh split_bowties(const Mesh& mesh) {
  const kit::EdgeTable table = kit::edge_table(mesh);
  std::vector<std::uint32_t> root(mesh.triangles.size() * 3);  // one node per corner of a triangle
  std::iota(root.begin(), root.end(), 0u);
  const auto find = [&](std::uint32_t c) {
    while (root[c] != c) c = root[c] = root[root[c]];
    return c;
  };
  const auto join = [&](std::uint32_t a, std::uint32_t b) {
    a = find(a), b = find(b);
    root[std::max(a, b)] = std::min(a, b);
  };
  const auto after = [](std::uint32_t h) { return h - h % 3 + (h % 3 + 1) % 3; };
  for (std::uint32_t h = 0; h < root.size(); ++h)
    if (const std::uint32_t twin = table.twin[h]; twin != kit::kNoTwin) {
      join(h, after(twin));
      join(after(h), twin);
    }

  constexpr std::uint32_t kUnset = 0xFFFFFFFFu;
  Mesh out = mesh;
  std::vector<std::uint32_t> fan_of_vertex(mesh.positions.size(),
                                           kUnset);  // its first fan keeps the index
  std::vector<std::uint32_t> vertex_of_fan(root.size(), kUnset);
  for (std::uint32_t c = 0; c < root.size(); ++c) {
    const std::uint32_t v = mesh.triangles[c / 3][c % 3], fan = find(c);
    if (vertex_of_fan[fan] == kUnset) {
      if (fan_of_vertex[v] == kUnset) {
        fan_of_vertex[v] = fan;
        vertex_of_fan[fan] = v;
      } else {
        vertex_of_fan[fan] = static_cast<std::uint32_t>(out.positions.size());
        out.positions.push_back(mesh.positions[v]);
      }
    }
    out.triangles[c / 3][c % 3] = vertex_of_fan[fan];
  }
  return out;
}

}  // namespace mr::merge
