#include "mr/simplify/vertex_rings.h"

#include <algorithm>
#include <bit>

#include "mr/core/assert.h"
#include "mr/kit/float4.h"

namespace mr::simplify {

namespace {

using Line = VertexRings::Line;

constexpr Line kPlaces{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
constexpr Line kEmpty{kNoVertex, kNoVertex, kNoVertex, kNoVertex, kNoVertex, kNoVertex,
                      kNoVertex, kNoVertex, kNoVertex, kNoVertex, kNoVertex, kNoVertex,
                      kNoVertex, kNoVertex, kNoVertex, kNoVertex};

/// How many lanes hold a ring of this size: short rings are half a line, which is most of
/// them.
std::uint32_t lanes_of(std::uint32_t size) { return size <= 8 ? 8 : 16; }

/// Bit i: lane i of the first `lanes` is v.
std::uint32_t find(const std::uint32_t* line, std::uint32_t lanes, std::uint32_t v) {
  std::uint32_t found = 0;
  for (std::uint32_t i = 0; i < lanes; i += 4)
    found |= kit::sign_bits(kit::load4<kit::UInt4>(line + i) == v) << i;
  return found;
}
/// Where v is, which the line names once.
std::uint32_t place_of(const std::uint32_t* line, std::uint32_t lanes, std::uint32_t v) {
  return static_cast<std::uint32_t>(std::countr_zero(find(line, lanes, v)));
}

/// Half a line.
struct EightNeighbours {
  kit::UInt4 low, high;

  static EightNeighbours load(const std::uint32_t* from) {
    return {kit::load4<kit::UInt4>(from), kit::load4<kit::UInt4>(from + 4)};
  }
  void store(std::uint32_t* to) const { kit::store4(low, to), kit::store4(high, to + 4); }
};

/// Replaces the element at `at` of a line with `size` elements by the first `count` of `with`, of
/// which a whole line's length must be readable.
void insert(const std::uint32_t* with, std::uint32_t count, std::uint32_t at, std::uint32_t size,
            Line& line) {
  const std::uint32_t result = size - 1 + count;
  if (size <= 8 && result <= 8) {
    // Loads everything before storing; each store overwrites the surplus of the one before.
    const EightNeighbours middle = EightNeighbours::load(with),
                          tail = EightNeighbours::load(&line[at + 1]);
    middle.store(&line[at]);
    tail.store(&line[at + count]);
    EightNeighbours::load(kEmpty.data()).store(&line[result]);
    return;
  }
  const Line before = line;
  line = kEmpty;
  std::copy_n(before.begin(), at, line.begin());
  std::copy_n(with, count, line.begin() + at);
  std::copy(before.begin() + at + 1, before.begin() + size, line.begin() + at + count);
}

/// Removes the element at `at` from a line with `size` elements.
void take_out(std::uint32_t at, std::uint32_t size, Line& line) {
  if (size <= 8) {
    for (std::uint32_t i = 0; i < 8; i += 4) {
      const auto moves = static_cast<kit::UInt4>(kit::load4<kit::UInt4>(&kPlaces[i]) >= at);
      const kit::UInt4 here = kit::load4<kit::UInt4>(&line[i]),
                       next = kit::load4<kit::UInt4>(&line[i + 1]);
      kit::store4((here & ~moves) | (next & moves), &line[i]);
    }
    return;
  }
  std::copy(line.begin() + at + 1, line.begin() + size, line.begin() + at);
  line[size - 1] = kNoVertex;
}

/// A vertex's triangles on the way to a ring; [i]: counter-clockwise from a to b.
struct Fan {
  std::uint32_t size = 0;
  const std::uint32_t *a = nullptr, *b = nullptr;

  /// The triangles in order around the vertex; false: they are not a single fan. `open`: the fan
  /// has ends. Takes kLanes steps for every size, without unpredictable branches.
  template <std::uint32_t kLanes>
  bool order(std::array<std::uint8_t, VertexRings::kMost>& out, bool& open) const {
    constexpr std::uint8_t kEnd = 31;
    const std::uint32_t all = (1u << size) - 1;
    std::array<std::uint8_t, 32> next;  // the triangle that begins where this one ends
    std::uint32_t begun = 0;            // bit i: triangle i begins where another one ends
    for (std::uint32_t i = 0; i < kLanes; ++i) {
      const std::uint32_t found = i < size ? find(a, kLanes, b[i]) & all : 0;
      next[i] = static_cast<std::uint8_t>(std::countr_zero(found | 1u << kEnd));
      begun |= found;
    }
    next[kEnd] = kEnd;
    open = begun != all;
    auto at = static_cast<std::uint8_t>(open ? std::countr_zero(~begun) : 0);
    std::uint32_t seen = 0;
    for (std::uint32_t i = 0; i < kLanes; ++i) {
      out[i] = at;
      seen |= 1u << at;
      at = next[at];
    }
    // A single fan visits all triangles: a closed one cyclically, an open one up to its end.
    return (seen & all) == all;
  }
};

/// Turns lanes past the size into kNoVertex.
void end_after(std::uint32_t size, Line& line) {
  for (std::uint32_t i = 0; i < VertexRings::kMost; i += 4)
    kit::store4(kit::load4<kit::UInt4>(&line[i]) |
                    static_cast<kit::UInt4>(kit::load4<kit::UInt4>(&kPlaces[i]) >= size),
                &line[i]);
}

}  // namespace

void VertexRings::start(std::size_t vertices, bool labels) {
  rings_.resize(vertices);
  labels_.resize(labels ? vertices : 0);
  size_.resize(vertices);
  open_.resize(vertices);
  complex_.clear();
}

bool VertexRings::close(std::uint32_t v, std::span<const OppositeEdge> more,
                        std::vector<OppositeEdge>& all) {
  const std::uint32_t few = size_[v];
  const std::size_t count = few + more.size();
  Line a, b, labels{};
  EightNeighbours::load(&rings_[v][0]).store(&a[0]);
  EightNeighbours::load(&rings_[v][kFew]).store(&b[0]);
  if (has_labels()) labels = labels_[v];
  std::array<std::uint8_t, kMost> order;
  bool open = false, whole = false;
  if (more.empty()) {
    whole = Fan{few, a.data(), b.data()}.order<kFew>(order, open);
  } else if (count <= kMost) {
    for (std::size_t i = few; i < count; ++i)
      a[i] = more[i - few].a, b[i] = more[i - few].b, labels[i] = more[i - few].label;
    whole = Fan{static_cast<std::uint32_t>(count), a.data(), b.data()}.order<kMost>(order, open);
  }
  const std::size_t size = count + open;
  if (!whole || size < 3u - open || size > kMost) {
    for (std::uint32_t i = 0; i < few; ++i) all.push_back({a[i], b[i], labels[i]});
    all.insert(all.end(), more.begin(), more.end());
    return false;
  }
  Line& ring = rings_[v];
  const std::uint32_t lanes = lanes_of(static_cast<std::uint32_t>(count));
  for (std::uint32_t i = 0; i < lanes; ++i) ring[i] = a[order[i] % kMost];
  if (open) ring[count] = b[order[count - 1]];
  end_after(static_cast<std::uint32_t>(size), ring);
  if (has_labels())
    for (std::uint32_t i = 0; i < lanes; ++i) labels_[v][i] = labels[order[i] % kMost];
  size_[v] = static_cast<std::uint8_t>(size), open_[v] = open;
  return true;
}

void VertexRings::set_complex(std::uint32_t v, std::vector<OppositeEdge> triangles) {
  size_[v] = kComplex, open_[v] = 0;
  complex_[v] = std::move(triangles);
}

void VertexRings::copy(const VertexRings& from, std::uint32_t v,
                       const std::vector<std::uint32_t>& number, std::uint32_t as) {
  size_[as] = from.size_[v], open_[as] = from.open_[v];
  if (from.is_complex(v)) return;
  const Line& ring = from.rings_[v];
  rings_[as] = kEmpty;
  for (std::uint32_t i = 0; i < size_[as]; ++i) rings_[as][i] = number[ring[i]];
  if (has_labels()) labels_[as] = from.labels_[v];
}

void VertexRings::copy_complex(const VertexRings& from, const std::vector<std::uint32_t>& number) {
  for (const auto& [v, triangles] : from.complex_) {
    if (!from.alive(v)) continue;
    std::vector<OppositeEdge>& copy = complex_[number[v]];
    for (const OppositeEdge& t : triangles) copy.push_back({number[t.a], number[t.b], t.label});
  }
}

/// Whether v may lose one of its triangles.
bool VertexRings::may_lose_one(std::uint32_t v) const {
  if (is_complex(v)) return complex_.at(v).size() > 1;
  return size_[v] > 3u - open_[v];
}

bool VertexRings::may_collapse(std::uint32_t v, std::uint32_t i) const {
  const Line& ring = rings_[v];
  const std::uint32_t n = size_[v], u = ring[i], open = open_[v];
  if (is_complex(u)) return false;
  const Line& other = rings_[u];
  const std::uint32_t m = size_[u], common = 2 - open;
  const std::uint32_t size = n + m - 2 - common;  // of u's ring afterwards
  if (size > kMost || size < 3u - open_[u]) return false;
  // Link condition: the only common neighbours are the tips of the triangles that vanish.
  kit::UInt4 met{};
  const std::uint32_t lanes = lanes_of(n);
  for (std::uint32_t k = 0; k < m; ++k)
    for (std::uint32_t j = 0; j < lanes; j += 4)
      met -= static_cast<kit::UInt4>(kit::load4<kit::UInt4>(&ring[j]) == other[k]);
  if (kit::sum_lanes(met) != common) return false;
  if ((!open || i == 0) && !may_lose_one(ring[i + 1 < n ? i + 1 : 0])) return false;
  return (open && i == 0) || may_lose_one(ring[i > 0 ? i - 1 : n - 1]);
}

void VertexRings::rename(std::uint32_t in, std::uint32_t v, std::uint32_t u) {
  if (is_complex(in)) {
    for (OppositeEdge& o : complex_.find(in)->second) {
      if (o.a == v) o.a = u;
      if (o.b == v) o.b = u;
    }
    return;
  }
  Line& ring = rings_[in];
  for (std::uint32_t i = 0; i < lanes_of(size_[in]); i += 4) {
    const kit::UInt4 lanes = kit::load4<kit::UInt4>(&ring[i]);
    kit::store4(lanes == v ? u + kit::UInt4{} : lanes, &ring[i]);
  }
}

void VertexRings::remove_from_complex(std::uint32_t in, std::uint32_t v, std::uint32_t u) {
  rename(in, v, u);
  std::vector<OppositeEdge>& triangles = complex_.find(in)->second;
  const auto gone = std::find_if(triangles.begin(), triangles.end(),
                                 [](const OppositeEdge& o) { return o.a == o.b; });
  MR_ASSERT(gone != triangles.end());
  *gone = triangles.back(), triangles.pop_back();
}

/// Updates the ring of `in`: removes the triangle of `in`, v and u, and the neighbour v.
void VertexRings::remove(std::uint32_t in, std::uint32_t v, std::uint32_t u) {
  if (is_complex(in)) return remove_from_complex(in, v, u);
  Line& ring = rings_[in];
  const std::uint32_t n = size_[in], i = place_of(ring.data(), lanes_of(n), v);
  if (has_labels()) {
    Line& labels = labels_[in];
    const std::uint32_t before = i > 0 ? i - 1 : n - 1;
    // u, v, w: the triangle of v and w becomes that of u and w.
    if (ring[before] == u && (i > 0 || !open_[in])) labels[before] = labels[i];
    take_out(i, n, labels);
  }
  take_out(i, n, ring);
  size_[in] = static_cast<std::uint8_t>(n - 1);
}

std::uint32_t VertexRings::collapse(std::uint32_t v, std::uint32_t i) {
  // Around v: u, x, p..., y; around u: x, v, y. The p take the place of v. Where v lies on a
  // border, x or y is missing.
  const std::uint32_t n = size_[v], u = rings_[v][i], open = open_[v];
  const bool has_x = !open || i == 0, has_y = !open || i != 0;
  const std::uint32_t p = open ? (i == 0 ? 2 : 0) : i + 2, count = n - 3 + open;
  std::array<std::uint32_t, 3 * kMost> around;  // v's ring, and once more
  const auto twice = [&](const Line& line) {
    for (const std::uint32_t at : {0u, n})
      for (std::uint32_t k = 0; k < lanes_of(n); k += 8)
        EightNeighbours::load(&line[k]).store(&around[at + k]);
  };
  const std::uint32_t m = size_[u], at = place_of(rings_[u].data(), lanes_of(m), v);
  const std::uint32_t size = m - 1 + count;
  if (has_labels()) {
    twice(labels_[v]);
    insert(&around[p], count, at, m, labels_[u]);
    if (has_x) labels_[u][at > 0 ? at - 1 : size - 1] = around[i + 1];
  }
  twice(rings_[v]);
  insert(&around[p], count, at, m, rings_[u]);
  size_[u] = static_cast<std::uint8_t>(size), size_[v] = 0;
  for (std::uint32_t k = 0; k < count; ++k) rename(around[p + k], v, u);
  if (has_x) remove(around[i + 1], v, u);
  if (has_y) remove(around[i + n - 1], v, u);
  return 2 - open;
}

}  // namespace mr::simplify
