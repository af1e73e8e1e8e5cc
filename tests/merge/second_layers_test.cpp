#include "mr/merge/overlap/second_layers.h"

#include <gtest/gtest.h>

#include <vector>

#include "mr/kit/topology.h"
#include "support/meshes.h"

namespace mr {
namespace {

constexpr merge::SecondLayersConfig kConfig{.apart_m = 0.03, .large_m2 = 0.2};

/// A square of so many triangles along each edge, facing up.
Mesh square(Vec3f corner, float edge_m, int cells) {
  return test::grid(corner, {edge_m, 0, 0}, {0, edge_m, 0}, cells, cells);
}

TEST(SecondLayers, WhatLiesOverALargerSurfaceGoes) {
  std::vector<Mesh> parts{square({0, 0, 0}, 1, 40), square({0.3f, 0.3f, 0.02f}, 0.2f, 10)};
  merge::remove_second_layers(parts, kConfig);
  EXPECT_EQ(parts[0].triangles.size(), 3200u);
  EXPECT_TRUE(parts[1].triangles.empty());
}

TEST(SecondLayers, ThePartOrderDoesNotMatter) {
  std::vector<Mesh> parts{square({0.3f, 0.3f, 0.02f}, 0.2f, 10), square({0, 0, 0}, 1, 40)};
  merge::remove_second_layers(parts, kConfig);
  EXPECT_TRUE(parts[0].triangles.empty());
  EXPECT_EQ(parts[1].triangles.size(), 3200u);
}

TEST(SecondLayers, WhatReachesFurtherStaysThere) {
  std::vector<Mesh> parts{square({0, 0, 0}, 1, 40), square({0.9f, 0.3f, 0.01f}, 0.2f, 10)};
  merge::remove_second_layers(parts, kConfig);
  EXPECT_EQ(parts[1].triangles.size(), 100u);
  for (std::uint32_t t = 0; t < parts[1].triangles.size(); ++t)
    EXPECT_GT(parts[1].centroid(t).x, 1);
}

TEST(SecondLayers, SurfaceFurtherAwayOrFacingAnotherWayStays) {
  const Mesh floor = square({0, 0, 0}, 1, 40);
  const Mesh above = square({0.3f, 0.3f, 0.035f}, 0.2f, 10),
             beneath = test::grid({0.3f, 0.3f, -0.01f}, {0, 0.2f, 0}, {0.2f, 0, 0}, 10, 10),
             upright = test::grid({0.3f, 0.3f, -0.1f}, {0.2f, 0, 0}, {0, 0, 0.2f}, 10, 10);
  std::vector<Mesh> parts{floor, above, beneath, upright};
  merge::remove_second_layers(parts, kConfig);
  for (std::size_t i = 1; i < parts.size(); ++i) EXPECT_EQ(parts[i].triangles.size(), 200u) << i;
}

TEST(SecondLayers, ASurfaceOverItselfStays) {
  // A ramp that turns back over its own beginning: one component.
  Mesh ramp = square({0, 0, 0}, 0.5f, 10);
  append(ramp, test::grid({0.5f, 0, 0}, {0, 0, 0.02f}, {0, 0.5f, 0}, 1, 10));
  append(ramp, test::grid({0.5f, 0, 0.02f}, {-0.2f, 0, 0}, {0, 0.5f, 0}, 4, 10));
  std::vector<Mesh> parts{kit::weld(ramp), square({5, 5, 5}, 1, 4)};
  const std::size_t before = parts[0].triangles.size();
  merge::remove_second_layers(parts, kConfig);
  EXPECT_EQ(parts[0].triangles.size(), before);
}

TEST(SecondLayers, TrianglesOfAnySizeAreFound) {
  for (const float edge_m : {1.0f, 10.0f, 1000.0f}) {
    std::vector<Mesh> parts{square({0, 0, 0}, edge_m, 1), square({0.3f, 0.4f, 0.02f}, 0.2f, 10)};
    merge::remove_second_layers(parts, kConfig);
    EXPECT_TRUE(parts[1].triangles.empty()) << edge_m;
  }
}

TEST(SecondLayers, ATriangleGoesOnlyWhereAllOfItIsCovered) {
  for (const float edge_m : {0.4f, 3.0f}) {
    Mesh wall = square({0, 0, 0}, 1, 1), patch = square({0.1f, 0.1f, 0.02f}, edge_m, 10);
    if (edge_m > 1)
      for (Vec3f& p : patch.positions) p = p - Vec3f{1, 1, 0};
    set_triangle_sensors(wall, std::vector(wall.triangles.size(), SensorId{0}));
    set_triangle_sensors(patch, std::vector(patch.triangles.size(), SensorId{1}));
    std::vector<Mesh> parts{wall, patch};
    merge::remove_second_layers(parts, {.apart_m = 0.03, .large_m2 = 0.0125});
    EXPECT_EQ(parts[0].triangles.size(), edge_m > 1 ? 0u : 2u) << edge_m;
  }
}

TEST(SecondLayers, WhatOneSensorSawAsTwoSurfacesIsTwo) {
  Mesh table = square({0, 0, 0}, 1, 40);
  append(table, square({0.3f, 0.3f, 0.02f}, 0.2f, 10));  // a sheet held over it
  set_triangle_sensors(table, std::vector(table.triangles.size(), SensorId{0}));
  std::vector<Mesh> parts{table};
  merge::remove_second_layers(parts, kConfig);
  EXPECT_EQ(parts[0].triangles.size(), 3400u);
}

TEST(SecondLayers, OfLargeOnesTheSensorDecidesWhereverItsSurfaceHasBeenJoined) {
  Mesh first = square({0, 0, 0}, 1, 40), second = square({0, 0, 0.02f}, 2, 80);
  set_triangle_sensors(first, std::vector(first.triangles.size(), SensorId{7}));
  set_triangle_sensors(second, std::vector(second.triangles.size(), SensorId{3}));
  std::vector<Mesh> parts{first, second};
  merge::remove_second_layers(parts, kConfig);
  EXPECT_EQ(parts[0].triangles.size(), 3200u);
  EXPECT_EQ(parts[1].triangles.size(), 12800u - 3200u) << "where only it is, it stays";
}

TEST(SecondLayers, NothingIsNoError) {
  std::vector<Mesh> none, empty(2);
  merge::remove_second_layers(none, kConfig);
  merge::remove_second_layers(empty, kConfig);
  EXPECT_TRUE(empty[0].triangles.empty());
}

}  // namespace
}  // namespace mr
