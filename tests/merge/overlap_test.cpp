#include "mr/merge/overlap/overlap.h"

#include <gtest/gtest.h>

#include <cmath>

#include "mr/core/parallel.h"
#include "mr/merge/overlap/quality_grid.h"
#include "mr/merge/overlap/ray_grids.h"
#include "mr/merge/seam/zipper.h"
#include "support/meshes.h"
#include "support/rays.h"
#include "walls.h"

namespace mr {
namespace {

using test::part;
using test::wall;

using Owner = merge::MergeConfig::Owner;

std::vector<kit::Part> wall_seen_twice(float offset, float noise = 0.002f) {
  return {part(wall(-1, 0.4f, 0, 40, noise, 1), 0, {-0.5, 0, 0}),
          part(wall(-0.4f, 1, offset, 37, noise, 2), 1, {0.5, 0, 0})};
}

double overlap_area(const std::vector<Mesh>& meshes) {
  double sum = 0;
  for (const Mesh& m : meshes) sum += surface_area_m2(m);
  return sum;
}

TEST(Overlap, WallSeenTwiceBecomesOneLayer) {
  for (const Owner owner : {Owner::coherent, Owner::paper})
    for (const float offset : {0.0f, 0.004f, -0.006f}) {
      const auto kept = merge::remove_overlap(wall_seen_twice(offset), {.owner = owner});
      Mesh both = kept[0];
      append(both, kept[1]);
      // Nearest owners change with the noise; the majority rule leaves a few doubled triangles.
      if (owner == Owner::coherent) {
        EXPECT_LT(test::doubled_share(both, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 1}, 0.03f),
                  2e-3)
            << offset;
      }
      const double area = overlap_area(kept);
      EXPECT_GT(area, owner == Owner::coherent ? 3.7 : 3.0) << offset;
      EXPECT_LT(area, 4.4) << offset;
    }
}

TEST(Overlap, PaperRemovesTheFartherSheet) {
  // Both sensors see the same sheet in front; the other is 8 mm behind it.
  const std::vector<kit::Part> parts = {part(wall(-1, 1, 0.008f), 0, {-0.2, 0, 0}),
                                        part(wall(-1, 1, 0), 1, {0.2, 0, 0})};
  const auto kept = merge::remove_overlap(parts, {.owner = Owner::paper});
  EXPECT_LT(surface_area_m2(kept[0]), 0.05);
  EXPECT_GT(surface_area_m2(kept[1]), 3.95);
}

TEST(Overlap, CoherentKeepsTheBetterMeasurement) {
  // Sensor 1 stands closer and straight in front.
  const std::vector<kit::Part> parts = {part(wall(-1, 1, -0.005f), 0, {-2.5, 0, -2}),
                                        part(wall(-1, 1, 0), 1, {0, 0, 0.5})};
  const auto kept = merge::remove_overlap(parts, {.owner = Owner::coherent});
  EXPECT_LT(surface_area_m2(kept[0]), 0.05);
  EXPECT_NEAR(surface_area_m2(kept[1]), 4, 0.05);
}

TEST(Overlap, SheetsBeyondTheRangeBothStay) {
  const std::vector<kit::Part> parts = {part(wall(-1, 1, 0.1f), 0, {-0.2, 0, 0}),
                                        part(wall(-1, 1, 0), 1, {0.2, 0, 0})};
  EXPECT_NEAR(overlap_area(merge::remove_overlap(parts, {})), 8, 1e-3);
}

TEST(Overlap, BackOfAThinBoardStays) {
  // 6 mm thick: closer than the range, but the two sides face opposite ways.
  Mesh back = wall(-1, 1, 0.006f);
  for (Triangle& t : back.triangles) std::swap(t[1], t[2]);
  const std::vector<kit::Part> parts = {part(wall(-1, 1, 0), 0, {0, 0, 0}),
                                        part(back, 1, {0, 0, 4})};
  for (const Owner owner : {Owner::coherent, Owner::paper})
    EXPECT_NEAR(overlap_area(merge::remove_overlap(parts, {.owner = owner})), 8, 1e-3);
}

TEST(Overlap, InsideOnePartNothingIsDecided) {
  Mesh doubled = wall(-1, 1, 0);
  append(doubled, wall(-1, 1, 0.003f));
  const std::vector<kit::Part> parts = {part(doubled, 0, {0, 0, 0}),
                                        part(wall(3, 4, 0), 1, {3.5, 0, 0}, {3.5, 0, 2})};
  EXPECT_NEAR(surface_area_m2(merge::remove_overlap(parts, {})[0]), 8, 1e-3);
}

TEST(Overlap, LargeTrianglesAreCutAtTheBorder) {
  const std::vector<kit::Part> parts = {part(wall(-1, 0.4f, 0, 2), 0, {-0.5, 0, 0}),
                                        part(wall(-0.4f, 1, 0.003f, 2), 1, {0.5, 0, 0})};
  const auto kept = merge::remove_overlap(parts, {});
  EXPECT_GT(overlap_area(kept), 3.8);
  EXPECT_LT(overlap_area(kept), 4.02);
}

/// By how much the border between two owners of a wall wanders while noise changes, in m².
double wandering_m2(merge::QualityMemory* memory) {
  double sum = 0, last = 0;
  for (unsigned frame = 0; frame < 12; ++frame) {
    const std::vector<kit::Part> parts = {
        part(wall(-1, 0.4f, 0, 40, 0.004f, 2 * frame + 1), 0, {-0.5, 0, 0}),
        part(wall(-0.4f, 1, 0, 37, 0.004f, 2 * frame + 2), 1, {0.5, 0, 0})};
    const double area = surface_area_m2(merge::remove_overlap(parts, {}, memory)[0]);
    if (frame > 0) sum += std::abs(area - last);
    last = area;
  }
  return sum;
}

TEST(Overlap, NoiseDoesNotMoveTheBordersOfWhoRemembers) {
  merge::QualityMemory memory;
  EXPECT_LT(wandering_m2(&memory), 0.5 * wandering_m2(nullptr));
}

TEST(Overlap, WhoRemembersSeesThatASensorMoved) {
  merge::QualityMemory memory;
  const auto area_of_first = [&](double x) {
    const std::vector<kit::Part> parts = {part(wall(-1, 1, 0, 40), 0, {-0.5, 0, 0}),
                                          part(wall(-1, 1, 0, 37), 1, {x, 0, 1})};
    return surface_area_m2(merge::remove_overlap(parts, {}, &memory)[0]);
  };
  EXPECT_LT(area_of_first(0), 2);     // the second stands near the middle
  EXPECT_GT(area_of_first(40), 3.9);  // now far off: all goes to the first
}

TEST(Overlap, SameBytesOnAnyNumberOfThreads) {
  std::vector<std::vector<Mesh>> results;
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    arena.run([&] { results.push_back(merge::remove_overlap(wall_seen_twice(0.004f), {})); });
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

TEST(Overlap, OnePartAndEmptyPartsPassThrough) {
  const std::vector<kit::Part> one = {part(wall(-1, 1, 0), 0, {0, 0, 0})};
  EXPECT_EQ(merge::remove_overlap(one, {})[0].triangles.size(), one[0].mesh.triangles.size());
  const std::vector<kit::Part> with_empty = {part(wall(-1, 1, 0), 0, {0, 0, 0}),
                                             part({}, 1, {1, 0, 0})};
  const auto kept = merge::remove_overlap(with_empty, {});
  EXPECT_NEAR(surface_area_m2(kept[0]), 4, 1e-4);
  EXPECT_TRUE(kept[1].empty());
}

/// An upright LiDAR with a beam per degree, as far above the horizon as below.
SourceInfo lidar_source(std::uint32_t sensor, Vec3d eye, int most_deg = 50) {
  SourceInfo out;
  out.sensor = SensorId{sensor};
  Camera& c = out.depth_camera;
  c.model = CameraModel::lidar;
  c.width = 512, c.height = 2 * most_deg + 1;
  for (int row = 0; row < c.height; ++row)
    c.beam_altitude_rad.push_back((most_deg - row) * 0.0174533);
  c.beam_azimuth_rad.assign(c.height, 0);
  out.T_world_depth = {{}, eye};
  return out;
}

/// The four walls of a square of 4 m around the origin, 2 m high, facing inwards; y is down.
Mesh four_walls(int cells, float half = 2) {
  Mesh mesh = test::grid({-half, 1, half}, {2 * half, 0, 0}, {0, -2, 0}, cells, cells);
  append(mesh, test::grid({half, 1, half}, {0, 0, -2 * half}, {0, -2, 0}, cells, cells));
  append(mesh, test::grid({half, 1, -half}, {-2 * half, 0, 0}, {0, -2, 0}, cells, cells));
  append(mesh, test::grid({-half, 1, -half}, {0, 0, 2 * half}, {0, -2, 0}, cells, cells));
  return mesh;
}

TEST(Overlap, LidarAndKinectBecomeOneLayerAllAround) {
  // The Kinect stands before one wall and measures it better; the LiDAR has all four.
  const Mesh seen = wall(-1, 1, -0.004f, 30);
  const std::vector<kit::Part> parts = {{four_walls(40), 0.001f, {lidar_source(0, {0, 0, 0})}},
                                        part(seen, 1, {0, 0, 0.8})};
  const auto kept = merge::remove_overlap(parts, {});
  EXPECT_NEAR(surface_area_m2(kept[0]), 32 - 4, 0.4);
  EXPECT_NEAR(surface_area_m2(kept[1]), 4, 0.05);
}

TEST(Overlap, OfTwoLidarsTheNearerKeepsItsWall) {
  // Also behind and beside, where no pinhole looks.
  const std::vector<kit::Part> parts = {{four_walls(40), 0.001f, {lidar_source(0, {0, 0, -1})}},
                                        {four_walls(37), 0.001f, {lidar_source(1, {0, 0, 1})}}};
  const auto kept = merge::remove_overlap(parts, {});
  EXPECT_NEAR(overlap_area(kept), 32, 0.9);
  double behind[2] = {}, ahead[2] = {};
  for (int i = 0; i < 2; ++i)
    for (std::size_t t = 0; t < kept[i].triangles.size(); ++t) {
      const float z = kept[i].centroid(t).z;
      if (z < -1.9f) behind[i] += 0.5 * length(kept[i].area_normal(t));
      if (z > 1.9f) ahead[i] += 0.5 * length(kept[i].area_normal(t));
    }
  EXPECT_GT(behind[0], 7);  // all but its ends, which the farther one sees less at a slant
  EXPECT_LT(behind[1], 1);
  EXPECT_GT(ahead[1], 7);
  EXPECT_LT(ahead[0], 1);
}

TEST(RayGrids, OfALidarStayInItsField) {
  const auto grids = merge::camera_rays(lidar_source(0, {1, 2, 3}, 20), 0.05);
  EXPECT_EQ(grids.size(), 4u);  // neither up nor down
  std::size_t inside = 0, all = 0;
  for (const merge::RayGrid& grid : grids)
    for (int y = 0; y < grid.camera.height; ++y)
      for (int x = 0; x < grid.camera.width; ++x) {
        const Vec3d ray = normalized(grid.T_world_camera.rotation *
                                     unproject(grid.camera, {double(x), double(y)}));
        inside += std::abs(ray.y) < std::sin(20.6 * 0.0174533);
        ++all;
      }
  EXPECT_GT(inside, 4u * 30 * 60);
  EXPECT_GT(inside, 0.6 * static_cast<double>(all));
}

}  // namespace
}  // namespace mr
