#include "mr/merge/overlap/still_surface_mask.h"

#include <gtest/gtest.h>

#include "mr/core/parallel.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

using kit::Part;
using merge::StillSurfaceMask;
using test::grid;

constexpr Vec2d kWide{-0.8, 0.8}, kLeft{-0.8, 0}, kMiddle{-0.2, 0.2};

/// Upright at this depth, facing sensors that options along z; from x.x to x.y, as high as wide.
Mesh sheet(double z, Vec2d x = kWide) {
  const auto width = static_cast<float>(x.y - x.x);
  return grid({static_cast<float>(x.x), width / 2, static_cast<float>(z)}, {width, 0, 0},
              {0, -width, 0}, 16, 16);
}

/// What a sensor at the origin, or a bit to the right of it, has.
Part part(std::uint32_t sensor, Mesh mesh) {
  Part out{std::move(mesh), 0.001f, {test::source(sensor, Pose{{}, {0.1 * sensor, 0, 0}})}};
  set_sensor(out.mesh, SensorId{sensor});
  return out;
}

/// 1 cm voxels: what two sensors see within 18.6 mm of each other, 2 m away, coincides; within
/// 8.6 mm what one sees.
StillSurfaceMask cover_of(const Mesh& merged, const std::vector<Part>& parts) {
  return {merged, parts, {.voxel_m = 0.01, .calibration_error_m = 0.005}};
}

std::size_t left(const StillSurfaceMask& cover, const Part& moving) {
  return cover.uncovered(moving).triangles.size();
}
constexpr std::size_t kAll = 2 * 16 * 16;

TEST(StillSurfaceMask, PatchOfAStillWallGoes) {
  const std::vector<Part> parts{part(0, sheet(2)), part(1, {})};
  const StillSurfaceMask cover = cover_of(parts[0].mesh, parts);
  for (const double z : {1.994, 2.0, 2.006}) EXPECT_EQ(left(cover, part(0, sheet(z, kMiddle))), 0u);
}

TEST(StillSurfaceMask, WhatIsNotShownYetStays) {
  const std::vector<Part> parts{part(0, sheet(2)), part(1, {})};
  EXPECT_EQ(left(cover_of({}, parts), part(0, sheet(2, kMiddle))), kAll);
  const StillSurfaceMask cover = cover_of(sheet(2, kLeft), parts);
  EXPECT_EQ(left(cover, part(0, sheet(2, {0.1, 0.5}))), kAll);
  EXPECT_EQ(left(cover, part(0, sheet(2, {-0.5, -0.1}))), 0u);
}

TEST(StillSurfaceMask, HandAboveATableStays) {
  const std::vector<Part> parts{part(0, sheet(2)), part(1, sheet(2))};
  const StillSurfaceMask cover = cover_of(parts[0].mesh, parts);
  for (const double above : {0.012, 0.025, 0.045, 0.3})
    for (const std::uint32_t sensor : {0u, 1u})
      EXPECT_EQ(left(cover, part(sensor, sheet(2 - above, kMiddle))), kAll) << above;
}

TEST(StillSurfaceMask, HandAboveATableThatOnlyAnotherSensorHasStays) {
  const std::vector<Part> parts{part(0, {}), part(1, sheet(2))};
  const StillSurfaceMask cover = cover_of(parts[1].mesh, parts);
  EXPECT_EQ(left(cover, part(0, sheet(1.975, kMiddle))), kAll);
  EXPECT_EQ(left(cover, part(0, sheet(1.985, kMiddle))), 0u);  // not distinguishable from the table
  EXPECT_EQ(left(cover, part(0, sheet(2.015, kMiddle))), 0u);
}

/// Sensors do not agree where the table is: who has it behind the hand knows better.
TEST(StillSurfaceMask, HandStaysWhereAnotherSensorsTableLies) {
  const std::vector<Part> parts{part(0, sheet(2)), part(1, sheet(1.975))};
  const StillSurfaceMask cover = cover_of(parts[1].mesh, parts);
  EXPECT_EQ(left(cover, part(0, sheet(1.975, kMiddle))), kAll);
  EXPECT_EQ(left(cover, part(1, sheet(1.975, kMiddle))), 0u);
  EXPECT_EQ(left(cover, part(0, sheet(2, kMiddle))), 0u);  // its own, though that is not shown
}

/// From one pixel to the next the floor is 6 cm farther away.
TEST(StillSurfaceMask, PatchOfAFloorSeenAtAGrazingAngleGoes) {
  const auto floor = [](float high, float width, int n) {
    return grid({-width / 2, 0.8f - high, 3.25f + 0.375f * width}, {width, 0, 0},
                {0, 0, -0.75f * width}, n, n);
  };
  const std::vector<Part> parts{part(0, floor(0, 2, 16)), part(1, {})};
  const StillSurfaceMask cover = cover_of(parts[0].mesh, parts);
  EXPECT_EQ(left(cover, part(0, floor(0, 1.6f, 13))), 0u);
  EXPECT_EQ(left(cover, part(0, floor(0.02f, 1.6f, 13))), 2u * 13 * 13);  // 4 to 8 cm along the ray
}

TEST(StillSurfaceMask, WhatWasHiddenByStillSurfaceStays) {
  const std::vector<Part> parts{part(0, sheet(1.5, kMiddle)), part(1, sheet(2))};
  Mesh merged = parts[0].mesh;
  append(merged, parts[1].mesh);
  const StillSurfaceMask cover = cover_of(merged, parts);
  // A box that is gone: what its sensor sees behind is compared with the box, for now.
  EXPECT_EQ(left(cover, part(0, sheet(2, {-0.1, 0.1}))), kAll);
  EXPECT_EQ(left(cover, part(0, sheet(2, {0.4, 0.6}))), 0u);
}

TEST(StillSurfaceMask, WhatIsHalfCoveredStays) {
  const std::vector<Part> parts{part(0, sheet(2, kLeft))};
  const StillSurfaceMask cover = cover_of(parts[0].mesh, parts);
  Part one = part(0, {});
  one.mesh.positions = {{-0.3f, 0.1f, 2}, {0.3f, 0.1f, 2}, {-0.3f, -0.1f, 2}};
  one.mesh.triangles = {{0, 1, 2}};
  set_triangle_sensors(one.mesh, {SensorId{0}});
  EXPECT_EQ(left(cover, one), 1u);
  for (Vec3f& p : one.mesh.positions) p.x -= 0.4f;
  EXPECT_EQ(left(cover, one), 0u);
}

/// In a part of an inner merger, each triangle is tested from its own sensor.
TEST(StillSurfaceMask, TrianglesOfSeveralSensorsAreToldApart) {
  std::vector<Part> parts{part(0, sheet(2)), part(1, sheet(1.975))};
  Part both = parts[0];
  append(both.mesh, parts[1].mesh);
  both.sources.push_back(parts[1].sources[0]);
  const StillSurfaceMask cover = cover_of(parts[1].mesh, {both});
  Part moving = part(0, sheet(1.975, kMiddle));
  append(moving.mesh, part(1, sheet(1.975, kMiddle)).mesh);
  moving.sources = both.sources;
  const Mesh rest = cover.uncovered(moving);
  ASSERT_EQ(rest.triangles.size(), kAll);
  for (const SensorId view : triangle_sensors(rest)) EXPECT_EQ(view, SensorId{0});
}

TEST(StillSurfaceMask, WhatItKnowsNothingAboutStays) {
  std::vector<Part> parts{part(0, sheet(2))};
  const StillSurfaceMask cover = cover_of(parts[0].mesh, parts);
  EXPECT_EQ(left(cover, part(7, sheet(2, kMiddle))), kAll);               // no such sensor
  EXPECT_EQ(left(cover, part(0, sheet(2, {3, 3.4}))), kAll);              // out of sight
  EXPECT_EQ(left(cover, part(0, sheet(-2, kMiddle))), kAll);              // behind the camera
  EXPECT_EQ(left(StillSurfaceMask(), part(0, sheet(2, kMiddle))), kAll);  // no still surface
  EXPECT_EQ(left(cover_of({}, {}), part(0, sheet(2, kMiddle))), kAll);
  EXPECT_EQ(left(cover, part(0, {})), 0u);
  parts[0].sources[0].depth_camera.model = CameraModel::equirectangular;
  EXPECT_EQ(left(cover_of(parts[0].mesh, parts), part(0, sheet(2, kMiddle))), kAll);
}

TEST(StillSurfaceMask, SameOnAnyNumberOfThreads) {
  const std::vector<Part> parts{part(0, sheet(2)), part(1, sheet(1.99))};
  const Part moving = part(0, grid({-1, 1, 1.96f}, {2, 0, 0.08f}, {0, -2, 0}, 64, 64));
  std::vector<Mesh> rest;
  for (const int threads : {1, 2, 8})
    Arena(threads).run([&] { rest.push_back(cover_of(parts[1].mesh, parts).uncovered(moving)); });
  EXPECT_EQ(rest[0], rest[1]);
  EXPECT_EQ(rest[0], rest[2]);
  EXPECT_GT(rest[0].triangles.size(), 0u);
  EXPECT_LT(rest[0].triangles.size(), moving.mesh.triangles.size());
}

}  // namespace
}  // namespace mr
