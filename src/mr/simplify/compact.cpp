#include "mr/simplify/compact.h"

#include <utility>

#include "mr/core/parallel.h"

namespace mr::simplify {

std::uint32_t number_vertices(const WorkingMesh& mesh, std::vector<std::uint32_t>& number) {
  std::vector<std::uint32_t> first(mesh.ranges(), 0);
  mesh.for_each_range([&](std::uint32_t range) {
    for (std::uint32_t v = mesh.begin(range); v < mesh.end(range); ++v)
      first[range] += mesh.rings.alive(v);
  });
  std::uint32_t count = 0;
  for (std::uint32_t& n : first) count += std::exchange(n, count);
  number.resize(mesh.vertices());
  mesh.for_each_range([&](std::uint32_t range) {
    std::uint32_t next = first[range];
    for (std::uint32_t v = mesh.begin(range); v < mesh.end(range); ++v)
      if (mesh.rings.alive(v)) number[v] = next++;
  });
  return count;
}

void compact(const WorkingMesh& from, std::vector<std::uint32_t>& number, WorkingMesh& to) {
  const std::uint32_t count = number_vertices(from, number);
  to.resize(count, from.rings.has_labels());
  to.triangles = from.triangles;
  from.for_each_range([&](std::uint32_t range) {
    for (std::uint32_t v = from.begin(range); v < from.end(range); ++v) {
      if (!from.rings.alive(v)) continue;
      const std::uint32_t w = number[v];
      to.places[w] = from.places[v], to.quadrics[w] = from.quadrics[v];
      to.kinds[w] = from.kinds[v], to.next[w] = from.next[v];
      to.rings.copy(from.rings, v, number, w);
      to.spans[w] = to.rings.is_complex(w) || to.reaches_out(w);
    }
  });
  to.rings.copy_complex(from.rings, number);
}

}  // namespace mr::simplify
