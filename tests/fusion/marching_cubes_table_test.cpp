#include "mr/fusion/marching_cubes_table.h"

#include <gtest/gtest.h>

#include <map>

namespace mr::fusion {
namespace {

TEST(CellTriangles, UseExactlyTheCrossedEdges) {
  for (int inside = 0; inside < 256; ++inside) {
    std::array<bool, 12> used{};
    for (const auto& t : cell_triangles()[inside])
      for (const auto e : t) used[e] = true;
    for (int e = 0; e < 12; ++e) {
      const auto [low, axis] = kCellEdges[e];
      const bool crossed = (inside >> low & 1) != (inside >> (low | 1 << axis) & 1);
      EXPECT_EQ(used[e], crossed) << inside << " edge " << e;
    }
  }
}

TEST(CellTriangles, AreManifoldInsideTheCell) {
  for (int inside = 0; inside < 256; ++inside) {
    std::map<std::pair<int, int>, int> directed;
    for (const auto& t : cell_triangles()[inside])
      for (int i = 0; i < 3; ++i) ++directed[{t[i], t[(i + 1) % 3]}];
    for (const auto& [edge, n] : directed) EXPECT_EQ(n, 1) << inside;
  }
}

TEST(CellTriangles, OneCornerInsideFacesAwayFromIt) {
  // Corner 0 inside: the triangle over the edges along x, y, z in that order, seen from the far
  // corner.
  ASSERT_EQ(cell_triangles()[1].size(), 1u);
  const auto t = cell_triangles()[1][0];
  EXPECT_EQ(
      (std::array<int, 3>{kCellEdges[t[0]].axis, kCellEdges[t[1]].axis, kCellEdges[t[2]].axis}),
      (std::array<int, 3>{0, 1, 2}));
}

}  // namespace
}  // namespace mr::fusion
