#include "mr/merge/seam/zipper.h"

#include <gtest/gtest.h>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/seam/border.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

Mesh zip(std::vector<Mesh> parts, double gap = 0.06) {
  return merge::zip(parts, {.max_gap_m = gap, .edge_m = 0.025});
}

/// Area of the holes in the rectangle [x0, x1] x [y0, y1], seen along +z.
double open_area(const Mesh& mesh, float x0, float x1, float y0, float y1) {
  const Mesh* meshes[] = {&mesh};
  const kit::RayScene rays(meshes);
  constexpr int kN = 200;
  int open = 0;
  for (int j = 0; j < kN; ++j)
    for (int i = 0; i < kN; ++i)
      open +=
          !rays.first_hit({x0 + (x1 - x0) * (i + 0.5f) / kN, y0 + (y1 - y0) * (j + 0.5f) / kN, -10},
                          {0, 0, 1}, 0, 100);
  return static_cast<double>(open) / (kN * kN) * (x1 - x0) * (y1 - y0);
}

void expect_sound(const Mesh& mesh, Vec3f facing) {
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    EXPECT_GT(dot(mesh.area_normal(t), facing), 0);
}

TEST(Zipper, StraightGapBetweenDifferentBordersIsClosed) {
  // 3 cm apart; 50 against 33 edges, so no vertex faces another.
  const Mesh left = test::grid({0, 1, 0}, {1, 0, 0}, {0, -1, 0}, 50, 50);
  const Mesh right = test::grid({1.03f, 1, 0.005f}, {1, 0, 0}, {0, -1, 0}, 33, 33);
  const Mesh zipped = zip({left, right});
  EXPECT_NEAR(surface_area_m2(zipped), 2.03, 2e-3);
  EXPECT_LT(open_area(zipped, 0.01f, 2.02f, 0.01f, 0.99f), 1e-4);
  EXPECT_EQ(kit::components(zipped).area_m2.size(), 1u);
  expect_sound(zipped, {0, 0, -1});
}

TEST(Zipper, CoarseBorderIsCutToMeetAFineOne) {
  const Mesh left = test::grid({0, 1, 0}, {1, 0, 0}, {0, -1, 0}, 1, 1);
  const Mesh right = test::grid({1.03f, 1, 0}, {1, 0, 0}, {0, -1, 0}, 40, 40);
  const Mesh zipped = zip({left, right});
  EXPECT_NEAR(surface_area_m2(zipped), 2.03, 2e-3);
  EXPECT_LT(open_area(zipped, 0.01f, 2.02f, 0.01f, 0.99f), 1e-4);
  expect_sound(zipped, {0, 0, -1});
}

TEST(Zipper, JaggedHoleFilledByAnotherPart) {
  // A disc cut out of one grid, a smaller disc of another in its place.
  const auto disc = [](const Mesh& grid, float r, bool inside) {
    std::vector<std::uint8_t> keep;
    for (std::size_t t = 0; t < grid.triangles.size(); ++t) {
      const Vec3f c = grid.centroid(t) - Vec3f{0.5f, 0.5f, grid.positions[0].z};
      keep.push_back((length(c) < r) == inside);
    }
    return select_triangles(grid, keep);
  };
  const Mesh outer = disc(test::grid({0, 1, 0}, {1, 0, 0}, {0, -1, 0}, 45, 45), 0.30f, false);
  const Mesh inner = disc(test::grid({0, 1, 0.004f}, {1, 0, 0}, {0, -1, 0}, 38, 38), 0.27f, true);
  const Mesh zipped = zip({outer, inner});
  EXPECT_LT(open_area(zipped, 0.01f, 0.99f, 0.01f, 0.99f), 2e-4);
  EXPECT_LT(test::doubled_share(zipped, {0, 0, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, 0.05f), 2e-3);
  expect_sound(zipped, {0, 0, -1});
}

TEST(Zipper, WideGapsAndStepsStayOpen) {
  const Mesh left = test::grid({0, 1, 0}, {1, 0, 0}, {0, -1, 0}, 20, 20);
  EXPECT_NEAR(surface_area_m2(zip({left, test::grid({1.2f, 1, 0}, {1, 0, 0}, {0, -1, 0}, 20, 20)})),
              2, 1e-4);
  // A step of 30 cm in depth: a table's edge and the floor beneath.
  EXPECT_NEAR(
      surface_area_m2(zip({left, test::grid({1.01f, 1, 0.3f}, {1, 0, 0}, {0, -1, 0}, 20, 20)})), 2,
      1e-4);
}

TEST(Zipper, SurfacesFacingApartAreNotJoined) {
  Mesh back = test::grid({0, 1, 0.02f}, {1, 0, 0}, {0, -1, 0}, 20, 20);
  for (Triangle& t : back.triangles) std::swap(t[1], t[2]);
  EXPECT_NEAR(surface_area_m2(zip({test::grid({0, 1, 0}, {1, 0, 0}, {0, -1, 0}, 20, 20), back})), 2,
              1e-3);
}

TEST(Zipper, OverlapRemovalAndZipperGiveOneClosedWall) {
  const auto wall = [](float x0, float x1, float z, int n, unsigned seed) {
    return test::grid({x0, 1, 2 + z}, {x1 - x0, 0, 0}, {0, -2, 0}, n, n, 0.002f, seed);
  };
  const auto eye = [](double x) { return look_at({x, 0, 0}, {0, 0, 2}, {0, -1, 0}); };
  const std::vector<kit::Part> parts = {
      {wall(-1, 0.4f, 0, 30, 1), 0.001f, {test::source(0, eye(-0.5))}},
      {wall(-0.4f, 1, 0.006f, 23, 2), 0.001f, {test::source(1, eye(0.5))}}};
  const Mesh zipped = zip(merge::remove_overlap(parts, {}));
  EXPECT_LT(open_area(zipped, -0.98f, 0.98f, -0.98f, 0.98f), 2e-3);
  EXPECT_LT(test::doubled_share(zipped, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 1}, 0.05f), 4e-3);
  EXPECT_EQ(kit::count_nonmanifold_edges(zipped), 0u);
  EXPECT_EQ(kit::components(zipped).area_m2.size(), 1u);
  for (const Vec3f p : zipped.positions) EXPECT_NEAR(p.z, 2.003f, 0.006f);
}

/// Two walls with a long gap between them: longer than the cubes of 1.6 m that are closed at once,
/// and in the middle of them.
std::vector<Mesh> long_walls() {
  return {test::grid({0, 9, 0.8f}, {1, 0, 0}, {0, -9, 0}, 20, 450),
          test::grid({1.02f, 9, 0.805f}, {1, 0, 0}, {0, -9, 0}, 15, 310, 0.004f)};
}

TEST(Zipper, GapsAreClosedFromCubeToCube) {
  const Mesh zipped = zip(long_walls(), 0.025);
  EXPECT_LT(open_area(zipped, 0.01f, 2.01f, 0.01f, 8.99f), 1e-4);
  EXPECT_EQ(kit::components(zipped).area_m2.size(), 1u);
  expect_sound(zipped, {0, 0, -1});
}

TEST(Zipper, SameBytesOnAnyNumberOfThreads) {
  std::vector<Mesh> results;
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    arena.run([&] { results.push_back(zip(long_walls(), 0.025)); });
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

TEST(Zipper, AVertexInsideAPartCountsWhereAnotherPartsBorderLies) {
  // A corner of the first lies on the middle vertex of the second: an edge from there to the
  // second's border would be one of four triangles. Found in a building of 400 sensors.
  Mesh first, second;
  first.positions = {{0, 0.0014f, -0.013f}, {0, -0.001f, 0}, {-0.0259f, 0.0022f, -0.0401f}};
  first.triangles = {{0, 1, 2}};
  second.positions = {{0, -0.001f, 0},
                      {0.0049f, 0.0098f, -0.0098f},
                      {0, 0, 0},
                      {-0.0098f, 0.0059f, -0.0098f},
                      {0.0029f, 0.0098f, -0.0498f},
                      {0.0156f, 0.0596f, -0.04f}};
  second.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {4, 5, 1}};
  EXPECT_EQ(kit::count_nonmanifold_edges(kit::weld(zip({first, second}, 0.025))), 0u);
}

TEST(Border, BowtiesAreSplit) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 4}};
  const merge::Joined apart = merge::join_parts(std::vector<Mesh>{mesh});
  EXPECT_EQ(apart.mesh.positions.size(), 6u);
  EXPECT_NE(apart.mesh.triangles[0][0], apart.mesh.triangles[1][0]);
  EXPECT_EQ(apart.mesh.positions[5], mesh.positions[0]);
  EXPECT_EQ(apart.border.size(), 6u);
}

TEST(Border, EdgesOfThreeTrianglesComeApart) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
  const merge::Joined apart = merge::join_parts(std::vector<Mesh>{mesh});
  EXPECT_EQ(apart.border.size(), 9u);
  EXPECT_EQ(kit::count_nonmanifold_edges(apart.mesh), 0u);
}

}  // namespace
}  // namespace mr
