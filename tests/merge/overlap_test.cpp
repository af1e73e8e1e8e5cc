#include "mr/merge/overlap.h"

#include <gtest/gtest.h>

#include "mr/core/parallel.h"
#include "mr/merge/zipper.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

using Owner = MergeConfig::Owner;

/// A wall in the plane z = 2 + offset, facing -z, from x0 to x1.
Mesh wall(float x0, float x1, float offset, int cells = 40, float noise = 0, unsigned seed = 1) {
  return test::grid({x0, 1, 2 + offset}, {x1 - x0, 0, 0}, {0, -2, 0}, cells, cells, noise, seed);
}

merge::Part part(Mesh mesh, std::uint32_t sensor, Vec3d eye, Vec3d target = {0, 0, 2}) {
  return {std::move(mesh), 0.001f, {test::source(sensor, look_at(eye, target, {0, -1, 0}))}};
}

std::vector<merge::Part> wall_seen_twice(float offset, float noise = 0.002f) {
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
  const std::vector<merge::Part> parts = {part(wall(-1, 1, 0.008f), 0, {-0.2, 0, 0}),
                                          part(wall(-1, 1, 0), 1, {0.2, 0, 0})};
  const auto kept = merge::remove_overlap(parts, {.owner = Owner::paper});
  EXPECT_LT(surface_area_m2(kept[0]), 0.05);
  EXPECT_GT(surface_area_m2(kept[1]), 3.95);
}

TEST(Overlap, CoherentKeepsTheBetterMeasurement) {
  // Sensor 1 stands closer and straight in front.
  const std::vector<merge::Part> parts = {part(wall(-1, 1, -0.005f), 0, {-2.5, 0, -2}),
                                          part(wall(-1, 1, 0), 1, {0, 0, 0.5})};
  const auto kept = merge::remove_overlap(parts, {.owner = Owner::coherent});
  EXPECT_LT(surface_area_m2(kept[0]), 0.05);
  EXPECT_NEAR(surface_area_m2(kept[1]), 4, 0.05);
}

TEST(Overlap, SheetsBeyondTheRangeBothStay) {
  const std::vector<merge::Part> parts = {part(wall(-1, 1, 0.1f), 0, {-0.2, 0, 0}),
                                          part(wall(-1, 1, 0), 1, {0.2, 0, 0})};
  EXPECT_NEAR(overlap_area(merge::remove_overlap(parts, {})), 8, 1e-3);
}

TEST(Overlap, BackOfAThinBoardStays) {
  // 6 mm thick: closer than the range, but the two sides face opposite ways.
  Mesh back = wall(-1, 1, 0.006f);
  for (Triangle& t : back.triangles) std::swap(t[1], t[2]);
  const std::vector<merge::Part> parts = {part(wall(-1, 1, 0), 0, {0, 0, 0}),
                                          part(back, 1, {0, 0, 4})};
  for (const Owner owner : {Owner::coherent, Owner::paper})
    EXPECT_NEAR(overlap_area(merge::remove_overlap(parts, {.owner = owner})), 8, 1e-3);
}

TEST(Overlap, InsideOnePartNothingIsDecided) {
  Mesh doubled = wall(-1, 1, 0);
  append(doubled, wall(-1, 1, 0.003f));
  const std::vector<merge::Part> parts = {part(doubled, 0, {0, 0, 0}),
                                          part(wall(3, 4, 0), 1, {3.5, 0, 0}, {3.5, 0, 2})};
  EXPECT_NEAR(surface_area_m2(merge::remove_overlap(parts, {})[0]), 8, 1e-3);
}

TEST(Overlap, LargeTrianglesAreCutAtTheBorder) {
  const std::vector<merge::Part> parts = {part(wall(-1, 0.4f, 0, 2), 0, {-0.5, 0, 0}),
                                          part(wall(-0.4f, 1, 0.003f, 2), 1, {0.5, 0, 0})};
  const auto kept = merge::remove_overlap(parts, {});
  EXPECT_GT(overlap_area(kept), 3.8);
  EXPECT_LT(overlap_area(kept), 4.02);
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
  const std::vector<merge::Part> one = {part(wall(-1, 1, 0), 0, {0, 0, 0})};
  EXPECT_EQ(merge::remove_overlap(one, {})[0].triangles.size(), one[0].mesh.triangles.size());
  const std::vector<merge::Part> with_empty = {part(wall(-1, 1, 0), 0, {0, 0, 0}),
                                               part({}, 1, {1, 0, 0})};
  const auto kept = merge::remove_overlap(with_empty, {});
  EXPECT_NEAR(surface_area_m2(kept[0]), 4, 1e-4);
  EXPECT_TRUE(kept[1].empty());
}

}  // namespace
}  // namespace mr
