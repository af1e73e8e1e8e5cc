#include "mr/merge/overlap/free_space_carver.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/meshes.h"

namespace mr {
namespace {

using kit::Part;
using merge::FreeSpaceCarver;
using merge::StillSurfaceMask;

constexpr int kCapturesUntilEmpty = 15;

SourceInfo sensor(std::uint32_t id, Vec3d at, double turned_rad) {
  SourceInfo out;
  out.sensor = SensorId{id};
  out.depth_camera.width = 320, out.depth_camera.height = 240;
  out.depth_camera.fx = out.depth_camera.fy = 260;
  out.depth_camera.cx = 159.5, out.depth_camera.cy = 119.5;
  const double c = std::cos(turned_rad), s = std::sin(turned_rad);
  out.T_world_depth.rotation(0, 0) = c, out.T_world_depth.rotation(0, 2) = s;
  out.T_world_depth.rotation(2, 0) = -s, out.T_world_depth.rotation(2, 2) = c;
  out.T_world_depth.translation = at;
  out.confirmed_depth = {8, 40, 30, std::vector<std::uint8_t>(40 * 30, 1)};
  return out;
}

/// A wall 3 m away that both sensors have as still, and a box's front that only the first has: it
/// was carried away while the first sensor's view was occluded.
struct CarriedAway {
  Mesh wall = test::grid({-2, -1, 3}, {4, 0, 0}, {0, 2, 0}, 40, 20);
  Mesh box = test::grid({-0.2f, -0.2f, 1.5f}, {0.4f, 0, 0}, {0, 0.4f, 0}, 8, 8);
  std::vector<Part> parts{{wall, 0, {sensor(0, {0, 0, 0}, 0)}},
                          {wall, 0, {sensor(1, {1.5, 0, 0}, -0.5)}}};
  Mesh joined;
  merge::OverlapConfig config{.voxel_m = 0.01};

  CarriedAway() {
    append(parts[0].mesh, box);
    joined = parts[0].mesh;
    set_triangle_sensors(joined, std::vector<SensorId>(joined.triangles.size()));
    for (int row = 11; row < 19; ++row)
      for (int column = 15; column < 25; ++column)
        parts[0].sources[0].confirmed_depth.tiles[row * 40 + column] = 0;
  }
  std::vector<SourceInfo> sources() const { return {parts[0].sources[0], parts[1].sources[0]}; }
  double area_m2(const FreeSpaceCarver& empty) const {
    return surface_area_m2(empty.carved(joined));
  }
};

/// Whether any place becomes empty, or ceases to be, in some captures.
bool any_change(const CarriedAway& scene, int captures) {
  const StillSurfaceMask cover(scene.joined, scene.parts, scene.config);
  FreeSpaceCarver empty(scene.config);
  bool any = false;
  for (int i = 0; i < captures; ++i) any |= empty.update(cover, scene.sources()) > 0;
  return any;
}

TEST(FreeSpaceCarver, WhatAnotherSeesPastGoesAfterAWhile) {
  const CarriedAway scene;
  const StillSurfaceMask cover(scene.joined, scene.parts, scene.config);
  FreeSpaceCarver empty(scene.config);
  const double all = surface_area_m2(scene.joined);
  for (int i = 0; i + 1 < kCapturesUntilEmpty; ++i) {
    EXPECT_EQ(empty.update(cover, scene.sources()), 0);
    EXPECT_DOUBLE_EQ(scene.area_m2(empty), all);
  }
  EXPECT_GT(empty.update(cover, scene.sources()), 0.005);
  EXPECT_LT(scene.area_m2(empty), all - 0.8 * surface_area_m2(scene.box));
  EXPECT_GT(scene.area_m2(empty), all - 1.01 * surface_area_m2(scene.box));  // not the wall
  EXPECT_EQ(empty.update(cover, scene.sources()), 0);
}

TEST(FreeSpaceCarver, WhoMeasuresNothingSeesNoEmptiness) {
  CarriedAway scene;
  for (std::uint8_t& tile : scene.parts[1].sources[0].confirmed_depth.tiles) tile = 0;
  EXPECT_FALSE(any_change(scene, 3 * kCapturesUntilEmpty));
}

TEST(FreeSpaceCarver, WhatItsOwnSensorSeesStays) {
  CarriedAway scene;
  for (std::uint8_t& tile : scene.parts[0].sources[0].confirmed_depth.tiles) tile = 1;
  EXPECT_FALSE(any_change(scene, 3 * kCapturesUntilEmpty));
}

TEST(FreeSpaceCarver, ComesBackWhenItsSensorSeesItAgain) {
  CarriedAway scene;
  const StillSurfaceMask cover(scene.joined, scene.parts, scene.config);
  FreeSpaceCarver empty(scene.config);
  for (int i = 0; i < kCapturesUntilEmpty; ++i) empty.update(cover, scene.sources());
  for (std::uint8_t& tile : scene.parts[0].sources[0].confirmed_depth.tiles) tile = 1;
  EXPECT_GT(empty.update(cover, scene.sources()), 0.005);
  EXPECT_DOUBLE_EQ(scene.area_m2(empty), surface_area_m2(scene.joined));
}

/// The chunk that changed brings that already.
TEST(FreeSpaceCarver, WhatItsSensorNoLongerHasIsNoChange) {
  CarriedAway scene;
  FreeSpaceCarver empty(scene.config);
  const StillSurfaceMask before(scene.joined, scene.parts, scene.config);
  for (int i = 0; i < kCapturesUntilEmpty; ++i) empty.update(before, scene.sources());
  ASSERT_LT(scene.area_m2(empty), surface_area_m2(scene.joined));
  scene.parts[0].mesh = scene.joined = scene.wall;
  set_sensor(scene.joined, SensorId{0});
  const StillSurfaceMask after(scene.joined, scene.parts, scene.config);
  EXPECT_EQ(empty.update(after, scene.sources()), 0);
  EXPECT_DOUBLE_EQ(scene.area_m2(empty), surface_area_m2(scene.wall));
}

TEST(FreeSpaceCarver, WhatWasSeenThoughAnotherSeesPastItStays) {
  CarriedAway scene;
  const StillSurfaceMask cover(scene.joined, scene.parts, scene.config);
  FreeSpaceCarver empty(scene.config);
  const std::vector<SourceInfo> hidden = scene.sources();
  for (std::uint8_t& tile : scene.parts[0].sources[0].confirmed_depth.tiles) tile = 1;
  for (int i = 0; i < 64; ++i) empty.update(cover, scene.sources());
  for (int i = 0; i < 2 * kCapturesUntilEmpty; ++i) EXPECT_EQ(empty.update(cover, hidden), 0);
  EXPECT_DOUBLE_EQ(scene.area_m2(empty), surface_area_m2(scene.joined));
}

}  // namespace
}  // namespace mr
