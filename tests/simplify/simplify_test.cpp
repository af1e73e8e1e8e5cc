#include "mr/simplify/simplify.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "support/decimation.h"
#include "support/meshes.h"

namespace mr {
namespace {

using simplify::Simplified;

Simplified to_count(const Mesh& mesh, std::size_t triangles) {
  auto made = simplify::simplify(mesh, {.triangles = triangles});
  EXPECT_TRUE(made.ok());
  return *std::move(made);
}

Simplified to_ratio(const Mesh& mesh, double ratio) {
  return to_count(mesh, simplify::triangles_at(mesh, ratio));
}

/// A closed box whose faces are grids of n × n cells.
Mesh fine_box(Vec3f size, int n) {
  const Vec3f x{size.x, 0, 0}, y{0, size.y, 0}, z{0, 0, size.z};
  Mesh mesh;
  for (const Mesh& face :
       {test::grid({}, y, x, n, n), test::grid(z, x, y, n, n), test::grid({}, x, z, n, n),
        test::grid(y, z, x, n, n), test::grid({}, z, y, n, n), test::grid(x, y, z, n, n)})
    append(mesh, face);
  return kit::weld(mesh);
}

std::set<Vec3f> border_vertices(const Mesh& mesh) {
  const kit::EdgeTable edges = kit::edge_table(mesh);
  std::set<Vec3f> out;
  for (std::uint32_t h = 0; h < edges.uses.size(); ++h)
    if (edges.uses[h] == 1) out.insert(mesh.positions[kit::edge_from(mesh, h)]);
  return out;
}

TEST(Simplify, FlatGridLosesTrianglesButNothingElse) {
  const Mesh mesh = test::grid({0, 0, 1}, {2, 0, 0}, {0, 1, 0}, 60, 30);
  const Simplified small = to_ratio(mesh, 0.1);
  EXPECT_LE(small.mesh.triangles.size(), mesh.triangles.size() / 10 + 1);
  EXPECT_NEAR(surface_area_m2(small.mesh), 2.0, 1e-4);
  EXPECT_LT(small.error_m, 1e-4f);
  for (std::size_t t = 0; t < small.mesh.triangles.size(); ++t)
    EXPECT_GT(small.mesh.area_normal(t).z, 0);
}

TEST(Simplify, SphereStaysClosedAndReportsItsError) {
  const Mesh mesh = test::sphere({0, 0, 0}, 1, 60);
  const Simplified small = to_ratio(mesh, 0.2);
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
  EXPECT_EQ(to_ratio(mesh, 1).mesh, mesh);
  EXPECT_TRUE(to_count(Mesh{}, 0).mesh.empty());
}

TEST(Simplify, BoxKeepsItsEdgesAndCorners) {
  const Vec3f size{1, 0.5f, 0.3f};
  const Mesh mesh = fine_box(size, 24);
  ASSERT_EQ(kit::count_boundary_edges(mesh), 0u);
  const Simplified small = to_count(mesh, 100);
  EXPECT_LE(small.mesh.triangles.size(), 100u);
  EXPECT_EQ(kit::count_boundary_edges(small.mesh), 0u);
  EXPECT_NEAR(surface_area_m2(small.mesh), surface_area_m2(mesh), 1e-4);
  int corners = 0;
  for (const Vec3f p : small.mesh.positions)
    corners += (p.x < 1e-4f || p.x > size.x - 1e-4f) && (p.y < 1e-4f || p.y > size.y - 1e-4f) &&
               (p.z < 1e-4f || p.z > size.z - 1e-4f);
  EXPECT_EQ(corners, 8);
}

TEST(Simplify, ThinBoardKeepsBothSides) {
  const Mesh mesh = fine_box({1, 1, 0.01f}, 40);
  const Simplified small = to_ratio(mesh, 0.02);
  EXPECT_LE(small.mesh.triangles.size(), mesh.triangles.size() / 50 + 1);
  double up = 0, down = 0;
  for (std::size_t t = 0; t < small.mesh.triangles.size(); ++t)
    (small.mesh.area_normal(t).z > 0 ? up : down) += small.mesh.area_normal(t).z / 2;
  EXPECT_NEAR(up, 1, 1e-3);
  EXPECT_NEAR(down, -1, 1e-3);
}

TEST(Simplify, BordersKeepTheirCourse) {
  // A disc of 0.5 m with a hole of 0.2 m.
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 200, 20);
  for (Vec3f& p : mesh.positions) {
    const float turn = 1.5f * std::numbers::pi_v<float> * p.x, radius = 0.5f - 0.3f * p.y;
    p = {radius * std::cos(turn), radius * std::sin(turn), 0};
  }
  const Simplified small = to_ratio(mesh, 0.05);
  EXPECT_LE(small.mesh.triangles.size(), mesh.triangles.size() / 20 + 1);
  EXPECT_NEAR(surface_area_m2(small.mesh), surface_area_m2(mesh), 2e-3);
  const std::set<Vec3f> before = border_vertices(mesh);
  for (const Vec3f p : border_vertices(small.mesh)) EXPECT_TRUE(before.contains(p));
}

TEST(Simplify, ThinTipsOfABorderStay) {
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 40, 40);
  mesh.positions.push_back({0.5125f, 1.1f, 0});  // 10 cm beyond the last row
  mesh.triangles.push_back({40 * 41 + 21, 40 * 41 + 20, 41 * 41});
  const Simplified small = to_ratio(mesh, 0.05);
  float top = 0;
  for (const Vec3f p : small.mesh.positions) top = std::max(top, p.y);
  EXPECT_FLOAT_EQ(top, 1.1f);
}

TEST(Simplify, NoisyRoomStaysAManifoldThatFacesUp) {
  const Mesh mesh = test::room_seen_from_above();
  for (const double ratio : {0.5, 0.1, 0.02}) {
    const Simplified small = to_ratio(mesh, ratio);
    const auto target = std::ceil(ratio * static_cast<double>(mesh.triangles.size()));
    EXPECT_NEAR(static_cast<double>(small.mesh.triangles.size()), target, 1);
    EXPECT_EQ(kit::count_nonmanifold_edges(small.mesh), 0u);
    EXPECT_EQ(kit::components(small.mesh).area_m2.size(), 1u);
    double against = 0;  // noise at 2.5 cm turns single triangles of the steep steps at most
    for (std::size_t t = 0; t < small.mesh.triangles.size(); ++t)
      against += std::max(0.0f, -small.mesh.area_normal(t).z / 2);
    EXPECT_LT(against, 1e-3);
  }
}

TEST(Simplify, SameOnAnyNumberOfThreads) {
  const Mesh mesh = test::room_seen_from_above();
  std::vector<Simplified> results;
  for (const int threads : {1, 2, 8}) {
    std::vector<Simplified> same(4);
    Arena(threads).run([&] {
      parallel_for(same.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) same[i] = to_ratio(mesh, 0.1);
      });
    });
    results.insert(results.end(), same.begin(), same.end());
  }
  for (const Simplified& result : results) {
    EXPECT_EQ(result.mesh, results[0].mesh);
    EXPECT_EQ(result.error_m, results[0].error_m);
  }
}

TEST(Simplify, NoPartVanishes) {
  Mesh mesh;
  for (int i = 0; i < 200; ++i)
    append(mesh, test::grid({static_cast<float>(i), 0, 0}, {0.5f, 0, 0}, {0, 0.5f, 0}, 1, 1));
  append(mesh, test::box({0, 5, 0}, {1, 6, 1}));
  for (int i = 0; i < 2000; ++i) {
    Mesh single{{{0, 10, 0}, {1, 10, 0}, {0, 11, 0}}, {{0, 1, 2}}, {}, {}};
    for (Vec3f& p : single.positions) p.z = static_cast<float>(i);
    append(mesh, single);
  }
  const Simplified small = to_count(mesh, 0);
  EXPECT_EQ(kit::components(small.mesh).area_m2.size(), 2201u);
  EXPECT_EQ(kit::count_nonmanifold_edges(small.mesh), 0u);
}

TEST(Simplify, DegenerateInputsDoNoHarm) {
  Mesh mesh = test::room_seen_from_above();
  const auto base = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.triangles.push_back({5, 5, 6});            // a corner twice
  mesh.triangles.push_back(mesh.triangles[100]);  // a triangle twice
  mesh.triangles.push_back({300, 301, 9000});     // a third one at an edge
  mesh.positions.insert(mesh.positions.end(), 3, {1, 1, 1});
  mesh.triangles.push_back({base, base + 1, base + 2});  // three corners at one place
  mesh.positions.push_back({9, 9, 9});                   // of no triangle
  const Simplified small = to_ratio(mesh, 0.05);
  EXPECT_LE(small.mesh.triangles.size(), mesh.triangles.size() / 20 + 1);
  EXPECT_TRUE(std::isfinite(small.error_m));
  for (const Vec3f p : small.mesh.positions) EXPECT_TRUE(is_finite(p));
  EXPECT_LE(kit::count_nonmanifold_edges(small.mesh), kit::count_nonmanifold_edges(mesh));
}

TEST(Simplify, VerticesOfManyTrianglesStay) {
  const Mesh mesh = test::sphere({0, 0, 0}, 1, 100);  // 200 triangles at each pole
  const Simplified small = to_ratio(mesh, 0.01);
  EXPECT_EQ(kit::count_boundary_edges(small.mesh), 0u);
  EXPECT_NEAR(surface_area_m2(small.mesh), 4 * std::numbers::pi, 0.3);
}

}  // namespace
}  // namespace mr
