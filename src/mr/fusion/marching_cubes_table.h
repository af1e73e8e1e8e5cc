#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace mr::fusion {

/// Cell corner c lies at (c & 1, c >> 1 & 1, c >> 2 & 1). Cell edge 4·axis + k is the k-th edge
/// along that axis; it runs from corner `low` to corner `low | 1 << axis`.
struct CellEdge {
  int low, axis;
};
inline constexpr std::array<CellEdge, 12> kCellEdges{{{0, 0},
                                                      {2, 0},
                                                      {4, 0},
                                                      {6, 0},
                                                      {0, 1},
                                                      {1, 1},
                                                      {4, 1},
                                                      {5, 1},
                                                      {0, 2},
                                                      {1, 2},
                                                      {2, 2},
                                                      {3, 2}}};

/// Triangles, as triples of cell edges, for each set of inside corners (bit c: corner c is inside).
/// Made by tracing the border between inside and outside over the cell's faces; on a face with two
/// opposite inside corners these are kept apart, from both sides of the face alike, so neighbouring
/// cells always fit and the surface has no cracks.
using CellTriangles = std::vector<std::array<std::uint8_t, 3>>;
const std::array<CellTriangles, 256>& cell_triangles();

}  // namespace mr::fusion
