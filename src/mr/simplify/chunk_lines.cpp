#include "mr/simplify/chunk_lines.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "mr/simplify/edge_collapser.h"

namespace mr::simplify {

namespace {

constexpr std::size_t kMostSkipped = 3;  // consecutive removed vertices: limits the size of rings

/// A border line between chunks. A closed line begins and ends with the same vertex.
using ChunkLine = std::vector<std::uint32_t>;

class ChunkLineFinder {
 public:
  ChunkLineFinder(std::span<const Label> labels, const WorkingMesh& mesh)
      : labels_(labels), mesh_(mesh) {}

  /// All lines, each in a direction that depends only on its ends' positions.
  std::vector<ChunkLine> find() const;

 private:
  bool is_on_line(std::uint32_t v) const;
  std::array<std::uint32_t, 2> neighbours(std::uint32_t v) const;
  void follow(std::uint32_t from, std::uint32_t next, std::vector<std::uint8_t>& seen,
              ChunkLine& line) const;
  void put_in_order(ChunkLine& line) const;
  Vec3f at(std::uint32_t v) const { return mesh_.places[v].at; }

  std::span<const Label> labels_;
  const WorkingMesh& mesh_;
};

bool ChunkLineFinder::is_on_line(std::uint32_t v) const {
  if (!mesh_.rings.alive(v) || mesh_.kinds[v] != VertexKind::crease) return false;
  const VertexRings::Line& ring = mesh_.rings.labels(v);
  for (std::uint32_t i = 1; i < mesh_.rings.size(v); ++i)
    if (labels_[ring[i]].chunk != labels_[ring[0]].chunk) return true;
  return false;
}

/// The vertices before and after a vertex on a line.
std::array<std::uint32_t, 2> ChunkLineFinder::neighbours(std::uint32_t v) const {
  const VertexRings::Line& ring = mesh_.rings.labels(v);
  const std::uint32_t size = mesh_.rings.size(v);
  std::array<std::uint32_t, 2> out{kNoVertex, kNoVertex};
  std::size_t n = 0;
  for (std::uint32_t i = 0; i < size && n < 2; ++i)
    if (ring[i] != ring[i > 0 ? i - 1 : size - 1]) out[n++] = mesh_.rings.ring(v)[i];
  return out;
}

/// Goes on with `next`, as long as that is on a line and new.
void ChunkLineFinder::follow(std::uint32_t from, std::uint32_t next,
                             std::vector<std::uint8_t>& seen, ChunkLine& line) const {
  for (;;) {
    line.push_back(next);
    if (!is_on_line(next) || seen[next]) return;
    seen[next] = 1;
    const auto [a, b] = neighbours(next);
    from = std::exchange(next, a == from ? b : a);
  }
}

/// A line with ends begins at the first of them. A ring, all of whose vertices are on the line, has
/// none: it begins at its first vertex. Both that and a loop, whose ends are one vertex beside the
/// line, go toward the first neighbour.
void ChunkLineFinder::put_in_order(ChunkLine& line) const {
  const auto before = [&](std::uint32_t v, std::uint32_t w) { return at(v) < at(w); };
  const bool is_closed = line.front() == line.back();
  if (is_closed && is_on_line(line.front())) {
    line.pop_back();
    std::rotate(line.begin(), std::min_element(line.begin(), line.end(), before), line.end());
    line.push_back(line.front());
  }
  const std::size_t first = is_closed ? 1 : 0;
  if (before(line[line.size() - 1 - first], line[first])) std::reverse(line.begin(), line.end());
}

std::vector<ChunkLine> ChunkLineFinder::find() const {
  std::vector<ChunkLine> out;
  std::vector<std::uint8_t> seen(mesh_.vertices(), 0);
  for (std::uint32_t v = 0; v < mesh_.vertices(); ++v) {
    if (seen[v] || !is_on_line(v)) continue;
    seen[v] = 1;
    const auto [back, on] = neighbours(v);
    ChunkLine line, rest;
    follow(v, back, seen, line);
    if (line.back() != v) {
      std::reverse(line.begin(), line.end());
      line.push_back(v);
      follow(v, on, seen, line);
    } else {
      line.insert(line.begin(), v);
    }
    put_in_order(line);
    out.push_back(std::move(line));
  }
  // Whatever numbers vertices have, lines are worked on in the same order.
  std::sort(out.begin(), out.end(),
            [&](const ChunkLine& a, const ChunkLine& b) { return at(a[1]) < at(b[1]); });
  return out;
}

float distance2(Vec3f p, Vec3f a, Vec3f b) {
  const Vec3f edge = b - a;
  const float length2 = dot(edge, edge);
  const float t = length2 > 0 ? std::clamp(dot(p - a, edge) / length2, 0.0f, 1.0f) : 0.0f;
  const Vec3f away = p - (a + edge * t);
  return dot(away, away);
}

/// Marks the vertices of a line that remain.
std::vector<std::uint8_t> choose(const ChunkLine& line, float error_m, const WorkingMesh& mesh) {
  std::vector<std::uint8_t> stays(line.size(), 0);
  stays.front() = stays.back() = 1;
  std::vector<std::pair<std::size_t, std::size_t>> spans{{0, line.size() - 1}};
  const auto at = [&](std::size_t i) { return mesh.places[line[i]].at; };
  while (!spans.empty()) {
    const auto [first, last] = spans.back();
    spans.pop_back();
    // A ring without ends is no line yet.
    float worst = first == 0 && line.front() == line.back() && last + 1 == line.size()
                      ? -1.0f
                      : error_m * error_m;
    std::size_t split = 0;
    for (std::size_t i = first + 1; i < last; ++i)
      if (const float d = distance2(at(i), at(first), at(last)); d > worst) worst = d, split = i;
    if (split == 0 && last - first > kMostSkipped + 1) split = (first + last) / 2;
    if (split == 0) continue;
    stays[split] = 1;
    spans.push_back({first, split}), spans.push_back({split, last});
  }
  return stays;
}

std::uint32_t place_in_ring(const VertexRings& rings, std::uint32_t v, std::uint32_t u) {
  std::uint32_t i = 0;
  while (i < rings.size(v) && rings.ring(v)[i] != u) ++i;
  return i;
}

/// Collapses the other vertices, each into the nearer remaining one, but if possible not into the
/// end of a line: many lines may end there, and rings must not grow too large.
void take_out(const ChunkLine& line, const std::vector<std::uint8_t>& stays,
              EdgeCollapser& collapser, WorkingMesh& mesh) {
  const auto pull = [&](std::uint32_t v, std::uint32_t& into) {
    const std::uint32_t place = place_in_ring(mesh.rings, v, into);
    const std::uint32_t gone = place < mesh.rings.size(v) ? collapser.collapse_into(v, place) : 0;
    mesh.triangles -= gone;
    if (gone == 0) into = v;
  };
  const std::size_t end = line.size() - 1;
  for (std::size_t first = 0, last = 1; first < end; first = last++) {
    while (!stays[last]) ++last;
    const std::size_t count = last - first - 1;
    std::size_t back = (count + 1) / 2;
    if (first == 0 && last != end) back = 0;
    if (first != 0 && last == end) back = count;
    std::uint32_t into = line[first];
    for (std::size_t i = first + 1; i <= first + back; ++i) pull(line[i], into);
    into = line[last];
    for (std::size_t i = last - 1; i > first + back; --i) pull(line[i], into);
  }
}

}  // namespace

void simplify_chunk_lines(std::span<const Label> labels, float error_m, WorkingMesh& mesh) {
  const std::vector<ChunkLine> lines = ChunkLineFinder(labels, mesh).find();
  EdgeCollapser collapser(mesh);
  for (const ChunkLine& line : lines) take_out(line, choose(line, error_m, mesh), collapser, mesh);
  for (const ChunkLine& line : lines)
    for (const std::uint32_t v : line)
      if (mesh.rings.alive(v)) mesh.kinds[v] = VertexKind::fixed, mesh.next[v] = kNever;
}

}  // namespace mr::simplify
