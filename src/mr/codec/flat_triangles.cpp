#include "mr/codec/flat_triangles.h"

#include <algorithm>
#include <cstdint>

#include "mr/kit/pair_map.h"

namespace mr::codec {
namespace {

constexpr int kRounds = 4;
constexpr std::uint32_t kNone = 0xFFFFFFFFu;

using Vec3l = Vec3<std::int64_t>;

/// The corner at which a flat triangle's longest edge starts.
int long_edge(const std::vector<Vec3i>& cells, const Triangle& t) {
  int best = 0;
  std::int64_t longest = -1;
  for (int i = 0; i < 3; ++i) {
    const Vec3l d =
        vec_cast<std::int64_t>(cells[t[(i + 1) % 3]]) - vec_cast<std::int64_t>(cells[t[i]]);
    if (dot(d, d) > longest) longest = dot(d, d), best = i;
  }
  return best;
}

std::uint64_t directed(std::uint32_t from, std::uint32_t to) {
  return static_cast<std::uint64_t>(from) << 32 | to;
}

/// For each flat triangle the triangle across its longest edge; kNone: there is none or several.
std::vector<std::uint32_t> behind(const std::vector<Vec3i>& cells,
                                  const std::vector<Triangle>& triangles,
                                  const std::vector<std::uint32_t>& flat) {
  kit::PairMap edges(flat.size());
  std::vector<std::uint8_t> touched(cells.size(), 0);
  std::vector<std::uint32_t> out(flat.size(), kNone);
  std::vector<std::uint8_t> owners(flat.size(), 0);
  for (std::uint32_t f = 0; f < flat.size(); ++f) {
    const Triangle& t = triangles[flat[f]];
    const int i = long_edge(cells, t);
    const std::uint32_t from = t[i], to = t[(i + 1) % 3];
    if (edges.get_or_add(directed(to, from), f) != f)
      owners[f] = 2;  // two flat triangles on one edge
    touched[from] = touched[to] = 1;
  }
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t from = triangles[t][i], to = triangles[t][(i + 1) % 3];
      if (!touched[from] || !touched[to]) continue;
      const std::uint32_t* f = edges.find(directed(from, to));
      if (f && owners[*f]++ == 0) out[*f] = t;
    }
  for (std::size_t f = 0; f < out.size(); ++f)
    if (owners[f] != 1) out[f] = kNone;
  return out;
}

}  // namespace

bool is_flat(const std::vector<Vec3i>& cells, const Triangle& t) {
  const Vec3l a = vec_cast<std::int64_t>(cells[t[0]]);
  return cross(vec_cast<std::int64_t>(cells[t[1]]) - a, vec_cast<std::int64_t>(cells[t[2]]) - a) ==
         Vec3l{};
}

void turn_flat_edges(const std::vector<Vec3i>& cells, std::vector<Triangle>& triangles,
                     std::vector<std::uint32_t>& labels) {
  for (int round = 0; round < kRounds; ++round) {
    std::vector<std::uint32_t> flat;
    for (std::uint32_t t = 0; t < triangles.size(); ++t)
      if (is_flat(cells, triangles[t])) flat.push_back(t);
    const std::vector<std::uint32_t> neighbour = behind(cells, triangles, flat);
    std::vector<std::uint8_t> turned(triangles.size(), 0);
    bool any = false;
    for (std::size_t f = 0; f < flat.size(); ++f) {
      const std::uint32_t t = flat[f], n = neighbour[f];
      if (n == kNone || turned[t] || turned[n] || is_flat(cells, triangles[n])) continue;
      const int i = long_edge(cells, triangles[t]);
      const std::uint32_t c = triangles[t][i], a = triangles[t][(i + 1) % 3],
                          b = triangles[t][(i + 2) % 3];
      const Triangle& other = triangles[n];
      const std::uint32_t d = *std::find_if(other.begin(), other.end(),
                                            [&](std::uint32_t v) { return v != a && v != c; });
      if (d == b) continue;
      triangles[t] = {a, b, d}, triangles[n] = {b, c, d};
      labels[t] = labels[n];
      turned[t] = turned[n] = 1;
      any = true;
    }
    if (!any) return;
  }
}

}  // namespace mr::codec
