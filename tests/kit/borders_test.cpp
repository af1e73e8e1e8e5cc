#include "mr/kit/borders.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "mr/kit/hole_filling.h"
#include "mr/kit/topology.h"
#include "support/meshes.h"

namespace mr::kit {
namespace {

/// A square of 10 x 10 cells of 1 cm without some cells, given as column + 10 row.
Mesh without_cells(const std::vector<int>& gone) {
  const Mesh mesh = test::grid({0, 0, 0}, {0.1f, 0, 0}, {0, 0.1f, 0}, 10, 10);
  std::vector<std::uint8_t> keep;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    keep.push_back(std::ranges::find(gone, static_cast<int>(t / 2)) == gone.end());
  return select_triangles(mesh, keep);
}

std::vector<std::size_t> sizes(const Mesh& mesh) {
  std::vector<std::size_t> out;
  const Borders borders(mesh);
  for (const BorderLoop& loop : borders.loops()) {
    out.push_back(loop.size());
    for (std::size_t i = 0; i < loop.size(); ++i)
      EXPECT_TRUE(borders.has_edge(loop[i], loop[(i + 1) % loop.size()]));
  }
  std::ranges::sort(out);
  return out;
}

TEST(Borders, ARimAndItsHolesAreLoops) {
  EXPECT_EQ(sizes({}), (std::vector<std::size_t>{}));
  EXPECT_EQ(sizes(test::sphere({0, 0, 0}, 1, 10)), (std::vector<std::size_t>{}));
  EXPECT_EQ(sizes(without_cells({})), (std::vector<std::size_t>{40}));
  EXPECT_EQ(sizes(without_cells({44})), (std::vector<std::size_t>{4, 40}));
  EXPECT_EQ(sizes(without_cells({44, 45})), (std::vector<std::size_t>{6, 40}));
}

TEST(Borders, HolesThatTouchInACornerAreTwoLoops) {
  EXPECT_EQ(sizes(without_cells({44, 55})), (std::vector<std::size_t>{4, 4, 40}));
}

TEST(Borders, AnEdgeOfThreeTrianglesEndsALoop) {
  Mesh mesh = without_cells({44});
  const Borders borders(mesh);
  const BorderLoop hole = *std::ranges::min_element(borders.loops(), {}, &BorderLoop::size);
  ASSERT_EQ(hole.size(), 4u);
  const auto tip = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.push_back({0.045f, 0.045f, 0.05f});
  mesh.triangles.push_back({hole[0], hole[1], tip});  // the same way as the surface there
  EXPECT_EQ(std::ranges::count(sizes(mesh), 4u), 0);
}

TEST(FillSmallHoles, ClosesWhatIsSmallAndTouchesNoOther) {
  const auto boundary = [](Mesh mesh, double max_perimeter_m) {
    fill_small_holes(mesh, max_perimeter_m);
    EXPECT_EQ(count_nonmanifold_edges(mesh), 0u);
    return count_boundary_edges(mesh);
  };
  EXPECT_EQ(boundary(without_cells({44}), 0.05), 40u);
  EXPECT_EQ(boundary(without_cells({44}), 0.03), 44u);
  EXPECT_EQ(boundary(without_cells({44, 45, 54, 55}), 0.09), 40u);
  EXPECT_EQ(boundary(without_cells({44, 55}), 0.05), 48u);
}

}  // namespace
}  // namespace mr::kit
