#include "mr/fusion/marching_cubes_table.h"

#include <algorithm>
#include <cstddef>

namespace mr::fusion {
namespace {

/// The cell edge between two neighbouring corners.
int edge_between(int a, int b) {
  for (int e = 0; e < 12; ++e) {
    const auto [low, axis] = kCellEdges[e];
    if (low == (a & b) && (low | 1 << axis) == (a | b)) return e;
  }
  return -1;
}

/// Corners of each face, counter-clockwise seen from outside the cell.
constexpr int kFaces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                              {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};

/// next[e] = the edge that follows crossed edge e on the surface's border polygon.
std::array<int, 12> trace_faces(int inside) {
  std::array<int, 12> next;
  next.fill(-1);
  const auto is_inside = [&](int corner) { return (inside >> corner & 1) != 0; };
  for (const auto& face : kFaces)
    for (int i = 0; i < 4; ++i) {
      if (is_inside(face[i]) || !is_inside(face[(i + 1) % 4]))
        continue;  // a run of inside corners begins
      int end = (i + 1) % 4;
      while (is_inside(face[(end + 1) % 4])) end = (end + 1) % 4;
      next[edge_between(face[i], face[(i + 1) % 4])] = edge_between(face[end], face[(end + 1) % 4]);
    }
  return next;
}

/// Whether two cell edges lie in one face of the cell.
bool share_face(int e, int f) {
  for (int normal = 0; normal < 3; ++normal)
    for (int side = 0; side < 2; ++side) {
      const auto in_face = [&](int edge) {
        return kCellEdges[edge].axis != normal && (kCellEdges[edge].low >> normal & 1) == side;
      };
      if (in_face(e) && in_face(f)) return true;
    }
  return false;
}

/// The corner of a polygon to spread triangles from. None of their inner sides should lie in a face
/// of the cell, or the next cell's may coincide with it and join four triangles.
std::size_t best_apex(const std::vector<int>& loop) {
  const std::size_t n = loop.size();
  const auto in_faces = [&](std::size_t apex) {
    int count = 0;
    for (std::size_t i = 2; i + 1 < n; ++i) count += share_face(loop[apex], loop[(apex + i) % n]);
    return count;
  };
  std::size_t best = 0;
  for (std::size_t apex = 1; apex < n; ++apex)
    if (in_faces(apex) < in_faces(best)) best = apex;
  return best;
}

CellTriangles triangulate(int inside) {
  std::array<int, 12> next = trace_faces(inside);
  CellTriangles out;
  for (int first = 0; first < 12; ++first) {
    if (next[first] < 0) continue;
    std::vector<int> loop;
    for (int e = first; next[e] >= 0;) {
      loop.push_back(e);
      const int follower = next[e];
      next[e] = -1;
      e = follower;
    }
    std::rotate(loop.begin(), loop.begin() + static_cast<std::ptrdiff_t>(best_apex(loop)),
                loop.end());
    for (std::size_t i = 2; i < loop.size(); ++i)
      out.push_back({static_cast<std::uint8_t>(loop[0]), static_cast<std::uint8_t>(loop[i - 1]),
                     static_cast<std::uint8_t>(loop[i])});
  }
  return out;
}

}  // namespace

const std::array<CellTriangles, 256>& cell_triangles() {
  static const std::array<CellTriangles, 256> table = [] {
    std::array<CellTriangles, 256> t;
    for (int inside = 0; inside < 256; ++inside) t[inside] = triangulate(inside);
    return t;
  }();
  return table;
}

}  // namespace mr::fusion
