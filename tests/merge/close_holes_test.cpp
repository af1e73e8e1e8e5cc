// Small holes are closed smoothly, and only those that are none in truth.
#include "mr/merge/holes/close_holes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "mr/kit/topology.h"
#include "mr/merge/holes/guessed_surface.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

using merge::close_holes;
using merge::GuessedTriangle;

/// A wall of a square metre at z = 1 that faces a sensor at the origin, in cells of 2 cm.
Mesh wall() { return test::grid({-0.5f, -0.5f, 1}, {0, 1, 0}, {1, 0, 0}, 50, 50); }

Mesh without(const Mesh& mesh, const std::function<bool(Vec3f)>& gone) {
  std::vector<std::uint8_t> keep;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) keep.push_back(!gone(mesh.centroid(t)));
  return select_triangles(mesh, keep);
}

Mesh with_round_hole(const Mesh& mesh, Vec3f middle, float radius_m) {
  return without(mesh, [&](Vec3f p) { return length(p - middle) < radius_m; });
}

/// What a sensor at the origin made of a surface.
std::vector<kit::Part> seen(const Mesh& mesh) {
  return {{mesh, 0, {test::source(0, look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}))}}};
}

std::size_t boundary_edges(const Mesh& mesh) { return kit::count_boundary_edges(mesh); }

TEST(CloseHoles, ASmallHoleInAWallIsClosedAndMarked) {
  Mesh mesh = with_round_hole(wall(), {0.05f, 0.05f, 1}, 0.022f);
  set_sensor(mesh, SensorId{4});
  const Mesh before = mesh;
  ASSERT_GT(boundary_edges(mesh), boundary_edges(wall()));
  const auto guessed = close_holes(mesh, seen(before), {});
  EXPECT_EQ(boundary_edges(mesh), boundary_edges(wall()));
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  EXPECT_EQ(mesh.triangles.size(), before.triangles.size() + guessed.size());
  EXPECT_NEAR(surface_area_m2(mesh), 1, 1e-4);
  EXPECT_EQ(mesh.sensors,
            (std::vector<SensorRun>{
                {0, static_cast<std::uint32_t>(mesh.triangles.size()), SensorId{4}}}));
  const auto marks = merge::GuessedSurface(guessed, 0.002).marks(mesh);
  ASSERT_EQ(marks.size(), mesh.triangles.size());
  for (std::size_t t = 0; t < marks.size(); ++t) {
    const bool was_hole = length(mesh.centroid(t) - Vec3f{0.05f, 0.05f, 1}) < 0.03f;
    EXPECT_LE(marks[t], was_hole) << t;
  }
  EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(marks, 1)), guessed.size());
}

TEST(CloseHoles, GuessesOfAnySizeAreFound) {
  for (const float edge_m : {0.02f, 1.0f, 1000.0f}) {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {edge_m, 0, edge_m}, {0, edge_m, edge_m}};
    mesh.triangles = {{0, 1, 2}};
    const std::vector<merge::GuessedTriangle> guessed{
        {mesh.positions[0], mesh.positions[1], mesh.positions[2]}};
    EXPECT_EQ(merge::GuessedSurface(guessed, 0.002).marks(mesh), (std::vector<std::uint8_t>{1}))
        << edge_m;
  }
}

TEST(CloseHoles, AWideHoleStaysAndSoDoesEverythingWhereNothingIsToBeFilled) {
  for (const auto& [radius_m, fill_m] : {std::pair{0.1f, 0.05}, {0.022f, 0.0}}) {
    Mesh mesh = with_round_hole(wall(), {0.05f, 0.05f, 1}, radius_m);
    const Mesh before = mesh;
    EXPECT_TRUE(close_holes(mesh, seen(before), {.fill_m = fill_m}).empty());
    EXPECT_EQ(mesh, before);
  }
}

TEST(CloseHoles, ALongSlitIsClosed) {
  Mesh mesh = without(
      wall(), [](Vec3f p) { return std::abs(p.x - 0.05f) < 0.01f && std::abs(p.y) < 0.3f; });
  const Mesh before = mesh;
  EXPECT_FALSE(close_holes(mesh, seen(before), {}).empty());
  EXPECT_EQ(boundary_edges(mesh), boundary_edges(wall()));
}

TEST(CloseHoles, WhatASensorSawThroughStaysOpen) {
  Mesh mesh = with_round_hole(wall(), {0.05f, 0.05f, 1}, 0.022f);
  const Mesh before = mesh;
  Mesh behind = test::grid({-1, -1, 2}, {0, 2, 0}, {2, 0, 0}, 20, 20);
  append(behind, before);
  EXPECT_TRUE(close_holes(mesh, seen(behind), {}).empty());
  // Another sensor's surface behind the hole proves nothing.
  std::vector<kit::Part> two = seen(before);
  two.push_back({test::grid({-1, -1, 2}, {0, 2, 0}, {2, 0, 0}, 20, 20),
                 0,
                 {test::source(1, look_at({3, 0, 1.5}, {0, 0, 1.5}, {0, -1, 0}))}});
  EXPECT_FALSE(close_holes(mesh, two, {}).empty());
}

TEST(CloseHoles, NeitherAnIslandIsCoveredNorItsRimClosed) {
  Mesh mesh = without(wall(), [](Vec3f p) {
    const float off = std::max(std::abs(p.x - 0.01f), std::abs(p.y - 0.01f));
    return off > 0.03f && off < 0.05f;
  });
  const Mesh before = mesh;
  EXPECT_TRUE(close_holes(mesh, seen(before), {.fill_m = 0.2}).empty());
  Mesh patch = test::grid({0, 0, 1}, {0, 0.03f, 0}, {0.03f, 0, 0}, 2, 2);
  const Mesh alone = patch;
  EXPECT_TRUE(close_holes(patch, seen(alone), {}).empty());
}

TEST(CloseHoles, AHoleInABallIsAsRoundAsTheBall) {
  constexpr float kRadius = 0.15f;
  const Vec3f middle{0, 0, 1.2f};
  const Mesh ball = test::sphere(middle, kRadius, 40);
  Mesh mesh = with_round_hole(ball, middle + Vec3f{0.106f, 0, -0.106f}, 0.035f);
  const Mesh before = mesh;
  const auto guessed = close_holes(mesh, seen(before), {.fill_m = 0.08});
  EXPECT_EQ(boundary_edges(mesh), 0u);
  float highest = 0;
  for (const GuessedTriangle& t : guessed)
    for (const Vec3f p : t) {
      const float radius = length(p - middle);
      EXPECT_NEAR(radius, kRadius, 0.0015f);
      highest = std::max(highest, radius);
    }
  for (const GuessedTriangle& t : guessed)  // outwards
    EXPECT_GT(dot(cross(t[1] - t[0], t[2] - t[0]), t[0] - middle), 0);
}

TEST(CloseHoles, NothingAndSoupsAreNoProblem) {
  Mesh none;
  EXPECT_TRUE(close_holes(none, {}, {}).empty());
  std::mt19937 random(3);
  for (int round = 0; round < 50; ++round) {
    Mesh soup;
    for (int v = 0; v < 30; ++v)
      soup.positions.push_back({static_cast<float>(random() % 8) * 0.01f,
                                static_cast<float>(random() % 8) * 0.01f,
                                1 + static_cast<float>(random() % 8) * 0.01f});
    for (int t = 0; t < 40; ++t) {
      const auto any = [&] { return static_cast<std::uint32_t>(random() % 30); };
      const Triangle triangle{any(), any(), any()};
      if (triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0])
        soup.triangles.push_back(triangle);
    }
    const std::size_t before = kit::count_nonmanifold_edges(soup);
    const Mesh parts = soup;
    close_holes(soup, seen(parts), {});
    EXPECT_EQ(kit::count_nonmanifold_edges(soup), before);
  }
}

}  // namespace
}  // namespace mr
