#include "mr/core/mesh.h"

#include <gtest/gtest.h>

#include <numbers>

#include "support/meshes.h"

namespace mr {
namespace {

constexpr std::uint32_t kNone = number_of(kNoView);

std::vector<ViewId> views(const std::vector<std::uint32_t>& numbers) {
  std::vector<ViewId> out;
  for (const std::uint32_t number : numbers) out.push_back(ViewId{number});
  return out;
}

Mesh square(float z = 0) { return test::grid({0, 0, z}, {1, 0, 0}, {0, 1, 0}, 1, 1); }

TEST(Mesh, SetTriangleViewsSortsStablyAndCoversAll) {
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 3, 1);
  const std::vector<Triangle> before = mesh.triangles;
  set_triangle_views(mesh, views({7, 2, kNone, 2, 7, 0}));
  const std::vector<ViewRun> runs = {
      {0, 1, ViewId{0}}, {1, 2, ViewId{2}}, {3, 2, ViewId{7}}, {5, 1, kNoView}};
  EXPECT_EQ(mesh.views, runs);
  const std::vector<Triangle> sorted = {before[5], before[1], before[3],
                                        before[0], before[4], before[2]};
  EXPECT_EQ(mesh.triangles, sorted);
  EXPECT_EQ(triangle_views(mesh), views({0, 2, 2, 7, 7, kNone}));
}

TEST(Mesh, WithoutRunsNoTriangleHasAView) {
  EXPECT_EQ(triangle_views(square()), (std::vector<ViewId>{kNoView, kNoView}));
}

TEST(Mesh, SelectKeepsTheChosenAndTheirVerticesOnly) {
  Mesh mesh = test::grid({0, 0, 0}, {2, 0, 0}, {0, 1, 0}, 2, 1);
  set_triangle_views(mesh, views({1, 1, 3, 3}));
  const Mesh part = select_triangles(mesh, {0, 1, 1, 0});
  ASSERT_EQ(part.triangles.size(), 2u);
  EXPECT_EQ(part.views, (std::vector<ViewRun>{{0, 1, ViewId{1}}, {1, 1, ViewId{3}}}));
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(part.corner(0, i), mesh.corner(1, i));
    EXPECT_EQ(part.corner(1, i), mesh.corner(2, i));
  }
  EXPECT_EQ(part.triangles[0], (Triangle{0, 1, 2})) << "vertices come in order of first use";
  EXPECT_LE(part.positions.size(), 6u);
}

TEST(Mesh, SelectNothingIsEmpty) {
  const Mesh none = select_triangles(square(), {0, 0});
  EXPECT_TRUE(none.empty());
  EXPECT_TRUE(none.positions.empty());
  EXPECT_TRUE(none.views.empty());
}

TEST(Mesh, AppendShiftsIndicesAndKeepsViews) {
  Mesh low = square(0), high = square(5);
  set_triangle_views(low, views({4, 4}));
  set_triangle_views(high, views({1, 4}));
  append(low, high);
  ASSERT_EQ(low.triangles.size(), 4u);
  EXPECT_EQ(low.positions.size(), 8u);
  EXPECT_EQ(low.views, (std::vector<ViewRun>{{0, 1, ViewId{1}}, {1, 3, ViewId{4}}}));
  EXPECT_EQ(low.corner(0, 0).z, 5);
  EXPECT_EQ(low.corner(1, 0).z, 0);
  EXPECT_EQ(low.corner(3, 2).z, 5);
}

TEST(Mesh, AppendToAnUnlabelledMeshLeavesItsTrianglesWithoutView) {
  Mesh plain = square(0), labelled = square(1);
  set_triangle_views(labelled, views({2, 2}));
  append(plain, labelled);
  EXPECT_EQ(plain.views, (std::vector<ViewRun>{{0, 2, ViewId{2}}, {2, 2, kNoView}}));

  Mesh a = square(0);
  append(a, square(1));
  EXPECT_TRUE(a.views.empty());
}

TEST(Mesh, AreasOfKnownShapes) {
  EXPECT_DOUBLE_EQ(surface_area_m2(square()), 1.0);
  EXPECT_NEAR(surface_area_m2(test::box({0, 0, 0}, {1, 2, 3})), 22.0, 1e-6);
  EXPECT_NEAR(surface_area_m2(test::sphere({1, 1, 1}, 2, 64)), 16 * std::numbers::pi, 0.1);
}

}  // namespace
}  // namespace mr
