#include "mr/merge/seam/advancing_front.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/core/assert.h"
#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

constexpr double kFullTurn = 4;      // of AdvancingFront::turn
constexpr double kTurnSlack = 1e-4;  // about a 10000th of a radian

}  // namespace

AdvancingFront::AdvancingFront(const Joined& joined, std::span<const std::uint8_t> wanted) {
  const Mesh& mesh = joined.mesh;
  std::vector<std::uint32_t> local = find_vertices(joined, wanted);
  for (std::size_t b = 0; b < wanted.size(); ++b) {
    if (!wanted[b]) continue;
    const std::uint32_t h = joined.border[b], e = size();
    edges_.emplace_back();
    add_live(local[kit::edge_from(mesh, h)], local[kit::edge_to(mesh, h)], e);
  }
  original_ = size();
  for (std::uint32_t e = 0; e < original_; ++e) {
    const std::uint32_t after = corner_at(edges_[e].to);
    MR_ASSERT(after == kNone || edges_[after].sibling == kNone);
    if (after != kNone) link(e, after);
  }
  look_at_triangles(mesh, std::move(local));
}

/// Takes the border's vertices at the places of wanted edges. Returns their numbers: [V of the
/// mesh], kNone for all others.
std::vector<std::uint32_t> AdvancingFront::find_vertices(const Joined& joined,
                                                         std::span<const std::uint8_t> wanted) {
  const Mesh& mesh = joined.mesh;
  std::vector<std::uint32_t> start, local(mesh.positions.size(), kNone);
  std::vector<Vec3f> positions;
  for (const std::uint32_t h : joined.border) {  // each border vertex starts one edge
    const std::uint32_t v = kit::edge_from(mesh, h);
    local[v] = static_cast<std::uint32_t>(start.size());
    start.push_back(v), positions.push_back(mesh.positions[v]);
  }
  const std::vector<std::uint32_t> place = kit::same_place(positions);
  std::vector<std::uint8_t> is_wanted(start.size(), 0);  // at a place
  for (std::size_t b = 0; b < wanted.size(); ++b)
    if (wanted[b])
      is_wanted[place[b]] = is_wanted[place[local[kit::edge_to(mesh, joined.border[b])]]] = 1;
  std::vector<std::uint32_t> last(start.size(), kNone);  // vertex at a place
  for (std::size_t b = 0; b < start.size(); ++b) {
    const std::uint32_t v = start[b];
    if (!is_wanted[place[b]]) {
      local[v] = kNone;
      continue;
    }
    local[v] = static_cast<std::uint32_t>(vertices_.size());
    std::uint32_t& before = last[place[b]];
    if (before != kNone) vertices_[before].next_here = local[v];
    Vertex vertex{positions[b], {}, v, joined.part[v], local[v]};
    if (before != kNone) vertex.place = vertices_[before].place;
    before = local[v];
    vertices_.push_back(vertex);
  }
  return local;
}

/// Finds the vertices' normals, and the edges between their places that have surface on the left.
void AdvancingFront::look_at_triangles(const Mesh& mesh, std::vector<std::uint32_t> local) {
  std::vector<std::uint32_t> triangles, inside;  // inside: corners that are not on the border
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    if (local[a] == kNone && local[b] == kNone && local[c] == kNone) continue;
    triangles.push_back(t);
    for (const std::uint32_t v : {a, b, c})
      if (local[v] == kNone) inside.push_back(v);
  }
  // Those of them that happen to lie where a vertex of another part's border does stand for it.
  std::vector<Vec3f> positions;
  for (const Vertex& v : vertices_) positions.push_back(v.at);
  for (const std::uint32_t v : inside) positions.push_back(mesh.positions[v]);
  const std::vector<std::uint32_t> same = kit::same_place(positions);
  for (std::size_t i = 0; i < inside.size(); ++i)
    if (const std::uint32_t v = same[vertices_.size() + i]; v < vertices_.size())
      local[inside[i]] = v;

  for (const std::uint32_t t : triangles) {
    const Triangle& corners = mesh.triangles[t];
    const Vec3f normal = mesh.area_normal(t);
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t from = local[corners[i]], to = local[corners[(i + 1) % 3]];
      if (from == kNone) continue;
      if (vertices_[from].of_mesh == corners[i]) vertices_[from].normal += normal;
      if (to == kNone || find_live(from, to) != kNone) continue;
      edges_.push_back({from, to});
      add_inner(size() - 1);
    }
  }
  for (Vertex& v : vertices_) v.normal = normalized(v.normal);
}

AdvancingFront::Workspace AdvancingFront::workspace(std::size_t edges) {
  const std::uint32_t begin = size();
  edges_.resize(edges_.size() + edges);
  return {begin, size(), {}};
}

std::uint32_t AdvancingFront::take(Workspace& space) {
  if (space.next == size()) edges_.emplace_back();
  return space.next++;
}

std::uint32_t AdvancingFront::add_edge(std::uint32_t from, std::uint32_t to, Workspace& space) {
  const std::uint32_t e = take(space);
  add_live(from, to, e);
  return e;
}

void AdvancingFront::add_live(std::uint32_t from, std::uint32_t to, std::uint32_t e) {
  std::uint32_t* last = &vertices_[from].corner;
  while (*last != kNone) last = &edges_[*last].sibling;
  *last = e;
  edges_[e] = {from, to, e, e, kNone, true};
}

void AdvancingFront::add_inner(std::uint32_t e) {
  edges_[e].alive = false;
  edges_[e].sibling = std::exchange(vertices_[vertices_[edges_[e].from].place].inner, e);
}

void AdvancingFront::retire(std::uint32_t e) {
  std::uint32_t* link = &vertices_[edges_[e].from].corner;
  while (*link != e) link = &edges_[*link].sibling;
  *link = edges_[e].sibling;
  add_inner(e);
}

/// Whether an edge that is not live leads from one vertex's place to another's.
bool AdvancingFront::has_inner(std::uint32_t from, std::uint32_t to) const {
  const std::uint32_t place = vertices_[to].place;
  std::uint32_t e = vertices_[vertices_[from].place].inner;
  while (e != kNone && vertices_[edges_[e].to].place != place) e = edges_[e].sibling;
  return e != kNone;
}

/// The live edge that leads from one vertex's place to another's, or kNone. Where borders of two
/// parts lie in one place, the one between these very vertices.
std::uint32_t AdvancingFront::find_live(std::uint32_t from, std::uint32_t to) const {
  for (std::uint32_t e = vertices_[from].corner; e != kNone; e = edges_[e].sibling)
    if (edges_[e].to == to) return e;
  const std::uint32_t place = vertices_[to].place;
  for (std::uint32_t v = vertices_[from].place; v != kNone; v = vertices_[v].next_here)
    for (std::uint32_t e = vertices_[v].corner; e != kNone; e = edges_[e].sibling)
      if (vertices_[edges_[e].to].place == place) return e;
  return kNone;
}

/// The turn from the direction to `reference` counter-clockwise to `other`, seen against the normal
/// at `vertex`: grows with the angle, 0 to 4 for a full turn, without its trigonometry.
double AdvancingFront::turn(std::uint32_t vertex, std::uint32_t reference,
                            std::uint32_t other) const {
  const Vertex& v = vertices_[vertex];
  const Vec3d n = vec_cast<double>(v.normal);
  const Vec3d r = vec_cast<double>(vertices_[reference].at - v.at),
              o = vec_cast<double>(vertices_[other].at - v.at);
  const double y = dot(n, cross(r, o)), x = dot(r, o) - dot(n, r) * dot(n, o);
  const double size = std::abs(x) + std::abs(y);
  if (size == 0) return 0;
  return x >= 0 ? (y >= 0 ? y / size : 4 + y / size) : 2 - y / size;
}

/// No third triangle: u → w and w → v must be free, and what lies behind them on the border.
bool AdvancingFront::edges_are_free(std::uint32_t u, std::uint32_t v, std::uint32_t w) const {
  for (const auto& [from, to] : {std::pair(u, w), std::pair(w, v)})
    if (has_inner(from, to) || has_inner(to, from) || find_live(from, to) != kNone) return false;
  return true;
}

bool AdvancingFront::fits_as_ear(std::uint32_t e, float least_cosine) const {
  const std::uint32_t corner = edges_[ear_corner(e)].from;
  const Vertex &u = vertices_[edges_[e].from], &v = vertices_[edges_[e].to], &w = vertices_[corner];
  if (w.place == u.place || w.place == v.place) return false;
  const Vec3f across = cross(u.at - v.at, w.at - v.at);
  const float least =
      std::min({dot(across, u.normal), dot(across, v.normal), dot(across, w.normal)});
  if (least_cosine > 0 && least < least_cosine * length(across)) return false;
  return dot(across, u.normal + v.normal + w.normal) > 0 &&
         edges_are_free(edges_[e].from, edges_[e].to, corner);
}

bool AdvancingFront::fits(std::uint32_t e, std::uint32_t corner) const {
  const Edge &edge = edges_[e], &c = edges_[corner];
  const std::uint32_t u = edge.from, v = edge.to, w = c.from;
  const auto place = [&](std::uint32_t vertex) { return vertices_[vertex].place; };
  if (!edge.alive || !c.alive || place(w) == place(u) || place(w) == place(v)) return false;

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

std::array<std::uint32_t, 2> AdvancingFront::fill(std::uint32_t e, std::uint32_t corner,
                                                  Workspace& space) {
  const Edge old = edges_[e];
  const std::uint32_t w = edges_[corner].from, before_w = edges_[corner].prev;
  const auto of_mesh = [&](std::uint32_t v) { return vertices_[v].of_mesh; };
  space.added.push_back({of_mesh(old.to), of_mesh(old.from), of_mesh(w)});
  const std::uint32_t behind = take(space);
  edges_[behind] = {old.to, old.from};
  add_inner(behind);
  std::array<std::uint32_t, 2> fresh{add_edge(old.from, w, space), add_edge(w, old.to, space)};
  const auto [in, out] = fresh;
  link(old.prev, in);
  link(in, corner);
  link(before_w, out);
  link(out, old.next);
  retire(e);
  close(in);
  close(out);
  for (std::uint32_t& f : fresh)
    if (!edges_[f].alive) f = kNone;
  return fresh;
}

void AdvancingFront::close(std::uint32_t e) {
  if (!edges_[e].alive) return;
  const std::uint32_t o = find_live(edges_[e].to, edges_[e].from);
  if (o == kNone) return;
  const Edge a = edges_[e], b = edges_[o];
  retire(e);
  retire(o);
  if (a.prev != o) link(a.prev, b.next);
  if (b.prev != e) link(b.prev, a.next);
}

std::optional<int> AdvancingFront::loop_length(std::uint32_t e, int limit) const {
  int count = 1;
  for (std::uint32_t k = edges_[e].next; k != e; k = edges_[k].next)
    if (++count > limit) return std::nullopt;
  return count;
}

}  // namespace mr::merge
