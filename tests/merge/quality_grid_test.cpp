#include "mr/merge/overlap/quality_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "mr/merge/overlap/cutter.h"
#include "mr/merge/seam/border_map.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

constexpr double kCell_m = 0.16;
constexpr Vec3f kTowardsUs{0, 0, -1};

/// The wall z = 2, from -1 to 1, seen from straight before it.
kit::Part wall_seen_from(double z, std::uint32_t sensor = 0) {
  return {test::grid({-1, 1, 2}, {2, 0, 0}, {0, -2, 0}, 50, 50),
          0.001f,
          {test::source(sensor, look_at({0, 0, z}, {0, 0, 2}, {0, -1, 0}))}};
}

/// The grid of some parts, and a reader.
struct Grid {
  explicit Grid(const std::vector<kit::Part>& parts) {
    for (const kit::Part& part : parts) measured.push_back(merge::measured(part, {}));
    grid.emplace(parts, measured, kCell_m, nullptr, false);
    reader.emplace(*grid);
  }
  float at(Vec3f place, std::uint32_t part = 0, Vec3f normal = kTowardsUs) {
    for (const auto& c : reader->at(place, normal))
      if (c.owner.part == part) return c.quality;
    return 0;
  }
  std::vector<merge::Measured> measured;
  std::optional<merge::QualityGrid> grid;
  std::optional<merge::QualityGrid::Reader> reader;
};

TEST(QualityGrid, QualitiesAreInverseToTheSpreads) {
  const std::vector<kit::Part> parts = {wall_seen_from(0), wall_seen_from(1, 1)};
  Grid grid(parts);
  const Precision& precision = parts[0].sources[0].precision;
  const double expected = precision.sigma_m(2) / precision.sigma_m(1);
  EXPECT_NEAR(grid.at({0, 0, 2}, 1) / grid.at({0, 0, 2}, 0), expected, 0.03 * expected);
}

TEST(QualityGrid, ALittleBeforeAndBehindItReadsTheSame) {
  Grid grid({wall_seen_from(0)});
  const float there = grid.at({0.1f, 0.2f, 2});
  for (const float z : {1.96f, 1.98f, 2.02f, 2.04f})
    EXPECT_NEAR(grid.at({0.1f, 0.2f, z}), there, 0.001f * there) << z;
  EXPECT_EQ(grid.at({0.1f, 0.2f, 3}), 0);
}

TEST(QualityGrid, OnlySurfaceThatFacesAlongTheAxisCounts) {
  Grid grid({wall_seen_from(0)});
  EXPECT_EQ(grid.at({0, 0, 2}, 0, {1, 0, 0}), 0);
  EXPECT_GT(grid.at({0, 0, 2}, 0, {0.7f, 0, -0.7f}), 0);
}

TEST(QualityGrid, ItFallsOffTowardsBorders) {
  Grid grid({wall_seen_from(0)});
  const float inside = grid.at({0.6f, 0, 2}), at_border = grid.at({1, 0, 2});
  EXPECT_LT(at_border, 0.98f * inside);
  EXPECT_GT(at_border, 0.8f * inside);
}

TEST(QualityGrid, BordersBetweenTheSourcesOfAPartDoNotCount) {
  kit::Part both = wall_seen_from(0);
  both.sources.push_back(both.sources[0]);
  both.sources[1].sensor = SensorId{1};
  std::vector<SensorId> views;
  for (std::size_t t = 0; t < both.mesh.triangles.size(); ++t)
    views.push_back(SensorId{both.mesh.centroid(t).x > 0});
  set_triangle_sensors(both.mesh, views);
  Grid one({wall_seen_from(0)}), two({both});
  for (const float x : {-0.3f, -0.05f, 0.0f, 0.1f})
    EXPECT_NEAR(two.at({x, 0, 2}), one.at({x, 0, 2}), 0.01f * one.at({x, 0, 2})) << x;
}

TEST(BorderMap, FindsBordersOfOtherPartsOnly) {
  const auto joined = [](float gap_m) {
    return merge::join_parts(
        std::vector<Mesh>{test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 20, 20),
                          test::grid({1 + gap_m, 0, 0}, {1, 0, 0}, {0, 1, 0}, 20, 20)});
  };
  const auto near_count = [](const merge::Joined& parts) {
    const merge::BorderMap map(parts, 0.05);
    return std::ranges::count(map.has_other_near(parts), 1);
  };
  EXPECT_EQ(near_count(joined(0.5f)), 0);
  EXPECT_GE(near_count(joined(0.04f)), 2 * 20);  // both sides
  EXPECT_LE(near_count(joined(0.04f)), 2 * 20 + 4 * 4);
}

TEST(Cutter, CutsWhereItIsToldAndKnowsItsParents) {
  const Mesh wall = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 10, 10);
  std::vector<float> margin;
  std::vector<std::uint8_t> keep;
  for (const Vec3f p : wall.positions) margin.push_back(0.43f - p.x), keep.push_back(p.x < 0.43f);
  const merge::Cut cut = merge::cut_at(wall, keep, [&](std::uint32_t a, std::uint32_t b) {
    return margin[a] / (margin[a] - margin[b]);
  });
  EXPECT_NEAR(surface_area_m2(cut.mesh), 0.43, 1e-5);
  ASSERT_EQ(cut.parent.size(), cut.mesh.triangles.size());
  for (std::size_t t = 0; t < cut.parent.size(); ++t) {
    Vec3f low = wall.corner(cut.parent[t], 0), high = low;
    for (int i = 1; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], wall.corner(cut.parent[t], i)[k]);
        high[k] = std::max(high[k], wall.corner(cut.parent[t], i)[k]);
      }
    const Vec3f middle = cut.mesh.centroid(t);
    for (int k = 0; k < 2; ++k) {
      EXPECT_GE(middle[k], low[k] - 1e-6f);
      EXPECT_LE(middle[k], high[k] + 1e-6f);
    }
  }
}

}  // namespace
}  // namespace mr
