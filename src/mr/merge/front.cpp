#include "mr/merge/front.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mr/core/assert.h"

namespace mr::merge {
namespace {

constexpr double kFullTurn = 4;      // of Front::turn
constexpr double kTurnSlack = 1e-4;  // about a 10000th of a radian

}  // namespace

Front::Front(const Mesh& mesh, std::span<const std::uint32_t> border,
             std::span<const std::uint8_t> wanted)
    : positions_(mesh.positions),
      normals_(mesh.positions.size()),
      place_(mesh.positions.size()),
      surface_(4 * border.size() + 16) {
  corner_.assign(mesh.positions.size(), kNone);
  find_places(mesh, border);
  for (std::size_t e = 0; e < border.size(); ++e)
    if (wanted[e]) add_edge(kit::edge_from(mesh, border[e]), kit::edge_to(mesh, border[e]));
  for (std::uint32_t e = 0; e < edges_.size(); ++e) {
    const std::uint32_t after = corner_[edges_[e].to];
    MR_ASSERT(after == kNone || edges_[after].sibling == kNone);
    if (after != kNone) link(e, after);
  }
  const std::vector<std::uint8_t> on_border = at_places_of_edges(mesh, border);
  for (const Triangle& t : mesh.triangles) {
    if (!(on_border[t[0]] | on_border[t[1]] | on_border[t[2]])) continue;
    const Vec3f n = cross(at(t[1]) - at(t[0]), at(t[2]) - at(t[0]));
    for (int i = 0; i < 3; ++i) {
      normals_[t[i]] += n;
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      if (on_border[a] && on_border[b]) surface_.get_or_add(directed(a, b), kInner);
    }
  }
  for (Vec3f& n : normals_) n = normalized(n);
}

/// Vertices of the border that lie at one place count as one.
void Front::find_places(const Mesh& mesh, std::span<const std::uint32_t> border) {
  std::vector<std::uint32_t> vertices;
  std::vector<Vec3f> positions;
  for (const std::uint32_t h : border)  // each border vertex starts one edge
    vertices.push_back(kit::edge_from(mesh, h)), positions.push_back(at(vertices.back()));
  std::iota(place_.begin(), place_.end(), 0u);
  const std::vector<std::uint32_t> same = kit::same_place(positions);
  for (std::size_t i = 0; i < vertices.size(); ++i) place_[vertices[i]] = vertices[same[i]];
}

/// [V] 1 for border vertices at places of the edges that are looked at.
std::vector<std::uint8_t> Front::at_places_of_edges(const Mesh& mesh,
                                                    std::span<const std::uint32_t> border) const {
  std::vector<std::uint8_t> at_place(place_.size(), 0), out(place_.size(), 0);
  for (const Edge& edge : edges_) at_place[place_[edge.from]] = at_place[place_[edge.to]] = 1;
  for (const std::uint32_t h : border)
    out[kit::edge_from(mesh, h)] = at_place[place_[kit::edge_from(mesh, h)]];
  return out;
}

std::uint32_t Front::add_edge(std::uint32_t from, std::uint32_t to) {
  const auto e = static_cast<std::uint32_t>(edges_.size());
  std::uint32_t* last = &corner_[from];
  while (*last != kNone) last = &edges_[*last].sibling;
  *last = e;
  edges_.push_back({from, to, e, e});
  surface_.get_or_add(directed(from, to), kInner) = e;
  return e;
}

void Front::retire(std::uint32_t e) {
  edges_[e].alive = false;
  std::uint32_t& there = surface_.get_or_add(directed(edges_[e].from, edges_[e].to), kInner);
  if (there == e) there = kInner;
  std::uint32_t* link = &corner_[edges_[e].from];
  while (*link != e) link = &edges_[*link].sibling;
  *link = edges_[e].sibling;
}

/// The turn from the direction to `reference` counter-clockwise to `other`, seen against the normal
/// at `vertex`: grows with the angle, 0 to 4 for a full turn, without its trigonometry.
double Front::turn(std::uint32_t vertex, std::uint32_t reference, std::uint32_t other) const {
  const Vec3d n = vec_cast<double>(normals_[vertex]);
  const Vec3d r = vec_cast<double>(at(reference) - at(vertex)),
              o = vec_cast<double>(at(other) - at(vertex));
  const double y = dot(n, cross(r, o)), x = dot(r, o) - dot(n, r) * dot(n, o);
  const double size = std::abs(x) + std::abs(y);
  if (size == 0) return 0;
  return x >= 0 ? (y >= 0 ? y / size : 4 + y / size) : 2 - y / size;
}

/// No third triangle: u → w and w → v must be free, and what lies behind them on the border.
bool Front::edges_are_free(std::uint32_t u, std::uint32_t v, std::uint32_t w) const {
  for (const auto& [from, to] : {std::pair(u, w), std::pair(w, v)}) {
    if (surface_.find(directed(from, to))) return false;
    if (const std::uint32_t* behind = surface_.find(directed(to, from));
        behind && *behind == kInner)
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
  const Edge &edge = edges_[e], &c = edges_[corner];
  const std::uint32_t u = edge.from, v = edge.to, w = c.from;
  if (!edge.alive || !c.alive || place_[w] == place_[u] || place_[w] == place_[v]) return false;

  // Inside the gap's angle, counter-clockwise from the incoming to the outgoing border edge.
  const auto gap_at = [&](std::uint32_t vertex, std::uint32_t in, std::uint32_t out) {
    const double t = turn(vertex, in, out);
    return t < kTurnSlack ? kFullTurn : t;
  };
  const std::uint32_t x = edges_[edge.prev].from, y = edges_[edge.next].to, a = edges_[c.prev].from,
                      b = c.to;
  if (x != w && turn(u, x, w) > gap_at(u, x, v) - kTurnSlack) return false;
  if (y != w) {
    const double to_w = turn(v, u, w);
    if (to_w < kTurnSlack || to_w > gap_at(v, u, y) + kTurnSlack) return false;
  }
  const double gap = gap_at(w, a, b);
  const double to_v = a == v ? 0 : turn(w, a, v), to_u = b == u ? gap : turn(w, a, u);
  if (to_v >= to_u || to_u > gap + kTurnSlack) return false;

  return edges_are_free(u, v, w);
}

std::vector<std::uint32_t> Front::fill(std::uint32_t e, std::uint32_t corner) {
  const Edge old = edges_[e];
  const std::uint32_t w = edges_[corner].from, before_w = edges_[corner].prev;
  added_.push_back({old.to, old.from, w});
  surface_.get_or_add(directed(old.to, old.from), kInner);
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
  const std::uint32_t* opposite = surface_.find(directed(edges_[e].to, edges_[e].from));
  if (!opposite || *opposite == kInner) return;
  const std::uint32_t o = *opposite;
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

}  // namespace mr::merge
