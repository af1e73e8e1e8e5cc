#include "mr/simplify/simplify.h"

#include <gtest/gtest.h>

#include "mr/kit/topology.h"
#include "support/meshes.h"

namespace mr {
namespace {

TEST(Simplify, FlatGridLosesTrianglesButNothingElse) {
  const Mesh mesh = test::grid({0, 0, 1}, {2, 0, 0}, {0, 1, 0}, 60, 30);
  const simplify::Simplified small = simplify::simplify_by_ratio(mesh, 0.1);
  EXPECT_LE(small.mesh.triangles.size(), mesh.triangles.size() / 10 + 1);
  EXPECT_NEAR(surface_area_m2(small.mesh), 2.0, 1e-4);
  EXPECT_LT(small.error_m, 1e-4f);
  for (std::size_t t = 0; t < small.mesh.triangles.size(); ++t)
    EXPECT_GE(small.mesh.area_normal(t).z, 0);
}

TEST(Simplify, SphereStaysClosedAndReportsItsError) {
  const Mesh mesh = test::sphere({0, 0, 0}, 1, 60);
  const simplify::Simplified small = simplify::simplify_by_ratio(mesh, 0.2);
  EXPECT_NEAR(static_cast<double>(small.mesh.triangles.size()),
              0.2 * static_cast<double>(mesh.triangles.size()),
              0.02 * static_cast<double>(mesh.triangles.size()));
  EXPECT_EQ(kit::count_boundary_edges(small.mesh), 0u);
  EXPECT_GT(small.error_m, 0);
  EXPECT_LT(small.error_m, 0.05f);
  for (const Vec3f p : small.mesh.positions) EXPECT_NEAR(length(p), 1, small.error_m + 1e-3f);
}

TEST(Simplify, WholeRatioAndEmptyMeshPassThrough) {
  const Mesh mesh = test::box({0, 0, 0}, {1, 1, 1});
  EXPECT_EQ(simplify::simplify_by_ratio(mesh, 1).mesh, mesh);
  EXPECT_TRUE(simplify::simplify(Mesh{}, 0).mesh.empty());
}

}  // namespace
}  // namespace mr
