#include "mr/merge/islands.h"

#include <gtest/gtest.h>

#include "support/meshes.h"

namespace mr {
namespace {

TEST(Islands, SmallOnesGoLargeOnesStay) {
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 4, 4);
  append(mesh, test::grid({3, 0, 0}, {0.03f, 0, 0}, {0, 0.03f, 0}, 1, 1));
  const Mesh kept = merge::remove_islands(mesh, merge::island_area_m2(0.01));
  EXPECT_EQ(kept.triangles.size(), 32u);
  EXPECT_EQ(kept.positions.size(), 25u);
  EXPECT_NEAR(surface_area_m2(kept), 1, 1e-6);
  EXPECT_EQ(merge::remove_islands(mesh, 0).triangles.size(), mesh.triangles.size());
}

TEST(Islands, ViewsAreKept) {
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  append(mesh, test::grid({3, 0, 0}, {0.01f, 0, 0}, {0, 0.01f, 0}, 1, 1));
  set_triangle_sensors(mesh, {SensorId{7}, SensorId{4}, SensorId{7}, SensorId{4}});
  EXPECT_EQ(triangle_sensors(merge::remove_islands(mesh, 0.01)),
            (std::vector<SensorId>{SensorId{4}, SensorId{7}}));
}

}  // namespace
}  // namespace mr
