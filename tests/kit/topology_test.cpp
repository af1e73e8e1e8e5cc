#include "mr/kit/topology.h"

#include <gtest/gtest.h>

#include "support/meshes.h"

namespace mr {
namespace {

TEST(Topology, ClosedMeshesHaveNoBoundary) {
  for (const Mesh& mesh : {test::sphere({0, 0, 0}, 1, 12), test::box({0, 0, 0}, {1, 2, 3})}) {
    EXPECT_EQ(kit::count_boundary_edges(mesh), 0u);
    EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  }
}

TEST(Topology, GridBoundaryIsItsPerimeter) {
  EXPECT_EQ(kit::count_boundary_edges(test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 5, 7)), 24u);
}

TEST(Topology, ThirdTriangleAtAnEdgeIsNotManifold) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, -1, 0}};
  mesh.triangles = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 1u);
}

TEST(Topology, WeldJoinsPiecesAndDropsDegenerateAndDoubledTriangles) {
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2, 2);
  append(mesh, test::grid({1, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2, 2));
  mesh.triangles.push_back(mesh.triangles.front());
  mesh.triangles.push_back({0, 0, 1});
  const Mesh welded = kit::weld(mesh);
  EXPECT_EQ(welded.positions.size(), 15u);
  EXPECT_EQ(welded.triangles.size(), 16u);
  EXPECT_EQ(kit::count_boundary_edges(welded), 12u);
}

TEST(Topology, ComponentsKnowTheirArea) {
  Mesh mesh = test::grid({0, 0, 0}, {2, 0, 0}, {0, 1, 0}, 3, 3);
  append(mesh, test::grid({0, 0, 5}, {0.5f, 0, 0}, {0, 0.5f, 0}, 2, 2));
  const kit::Components parts = kit::components(mesh);
  ASSERT_EQ(parts.area_m2.size(), 2u);
  EXPECT_NEAR(parts.area_m2[0], 2.0, 1e-6);
  EXPECT_NEAR(parts.area_m2[1], 0.25, 1e-6);
}

TEST(Topology, RefineKeepsTheSurfaceClosedAndItsArea) {
  const Mesh mesh = test::sphere({0, 0, 0}, 1, 10);
  std::vector<std::uint8_t> split(mesh.triangles.size() * 3, 0);
  for (std::size_t h = 0; h < split.size(); h += 7) split[h] = 1;
  const kit::Refined fine = kit::refine(mesh, split);
  EXPECT_GT(fine.mesh.triangles.size(), mesh.triangles.size());
  EXPECT_EQ(kit::count_boundary_edges(fine.mesh), 0u);
  EXPECT_EQ(kit::count_nonmanifold_edges(fine.mesh), 0u);
  EXPECT_NEAR(surface_area_m2(fine.mesh), surface_area_m2(mesh), 1e-5);
  for (std::size_t t = 0; t < fine.parent.size(); ++t)
    EXPECT_GT(dot(fine.mesh.area_normal(t), mesh.area_normal(fine.parent[t])), 0);
}

}  // namespace
}  // namespace mr
