#include "mr/merge/groups.h"

#include <gtest/gtest.h>

#include "mr/core/parallel.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/overlap/quality_grid.h"
#include "mr/merge/seam/zipper.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

using Groups = std::vector<std::vector<std::uint32_t>>;

Groups groups_of(const std::vector<Mesh>& meshes, double reach_m) {
  std::vector<const Mesh*> pointers;
  for (const Mesh& mesh : meshes) pointers.push_back(&mesh);
  return merge::connected_groups(pointers, reach_m);
}

/// Walls of 1 m, at x.
std::vector<Mesh> walls(const std::vector<float>& at, int n) {
  std::vector<Mesh> out;
  for (const float x : at) out.push_back(test::grid({x, 1, 2}, {1, 0, 0}, {0, -1, 0}, n, n));
  return out;
}

TEST(Groups, ThoseThatMeetAndChainsOfThem) {
  // 0, 3 and 5 in a row, 5 cm apart; 1 and 6 cross; 2, 4 and 7 alone.
  const std::vector<float> at{0, 10, 20, 1.05f, 30, 2.1f, 10.5f, 40};
  const Groups wanted{{0, 3, 5}, {1, 6}, {2}, {4}, {7}};
  for (const int n : {1, 7, 50}) EXPECT_EQ(groups_of(walls(at, n), 0.06), wanted) << n;
}

TEST(Groups, WhatIsFartherApartThanAFewReachesIsApart) {
  EXPECT_EQ(groups_of(walls({0, 1.5f, 3, 4.5f, 6, 7.5f, 9}, 30), 0.06).size(), 7u);
}

TEST(Groups, NoReachIsMissed) {  // wherever cells end
  for (int i = 0; i < 40; ++i) {
    const float x = 0.013f * static_cast<float>(i);
    const Groups groups =
        groups_of(walls({x, x + 1.059f, x + 10, x + 20, x + 30, x + 40, x + 50}, 3), 0.06);
    EXPECT_EQ(groups.size(), 6u) << i;
  }
}

TEST(Groups, FewAreOneAndHugeTrianglesMeetAll) {
  EXPECT_EQ(groups_of(walls({0, 10}, 2), 0.06).size(), 1u);
  auto meshes = walls({0, 10, 20, 30, 40, 50}, 2);
  EXPECT_EQ(groups_of({}, 0.06).size(), 0u);
  meshes.push_back(test::grid({0, 0.5f, 2}, {1000, 0, 0}, {0, -1000, 1000}, 1, 1));
  EXPECT_EQ(groups_of(meshes, 0.06).size(), 1u);
}

TEST(Groups, EmptyMeshesAreAlone) {
  std::vector<Mesh> meshes = walls({0, 0.5f, 1, 0, 0.5f, 1}, 5);
  meshes.resize(8);
  EXPECT_EQ(groups_of(meshes, 0.06), (Groups{{0, 1, 2, 3, 4, 5}, {6}, {7}}));
}

/// Two sensors before a wall, `rooms` times, 20 m apart.
std::vector<kit::Part> pairs_of_sensors(int rooms) {
  std::vector<kit::Part> out;
  for (int room = 0; room < rooms; ++room)
    for (int i = 0; i < 2; ++i) {
      const double x = 20.0 * room, eye = x + (i == 0 ? -0.5 : 0.5);
      const float left = static_cast<float>(x) + (i == 0 ? -1.0f : -0.4f);
      out.push_back({test::grid({left, 1, 2}, {1.4f, 0, 0}, {0, -2, 0}, 30, 30, 0.002f,
                                static_cast<unsigned>(i + 1)),
                     0.001f,
                     {test::source(static_cast<std::uint32_t>(out.size()),
                                   look_at({eye, 0, 0}, {x, 0, 2}, {0, -1, 0}))}});
    }
  return out;
}

Mesh merged(const std::vector<kit::Part>& parts, merge::QualityMemory* memory = nullptr) {
  return merge::zip(merge::remove_overlap(parts, {}, memory), merge::zipper_config(0.01));
}

TEST(Groups, RoomsMergeAsIfAlone) {
  const std::vector<kit::Part> all = pairs_of_sensors(5);
  std::size_t triangles = 0;
  double area_m2 = 0;
  for (std::size_t i = 0; i < all.size(); i += 2) {
    const Mesh room = merged({all[i], all[i + 1]});
    triangles += room.triangles.size(), area_m2 += surface_area_m2(room);
  }
  const Mesh together = merged(all);
  EXPECT_EQ(together.triangles.size(), triangles);
  EXPECT_NEAR(surface_area_m2(together), area_m2, 1e-4);
  EXPECT_EQ(together.sensors.size(), all.size());
}

TEST(Groups, SameBytesOnAnyNumberOfThreads) {
  std::vector<Mesh> results;
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    arena.run([&] {
      merge::QualityMemory memory;
      for (int frame = 0; frame < 2; ++frame)
        results.push_back(merged(pairs_of_sensors(5), &memory));
    });
  }
  for (const Mesh& mesh : results) EXPECT_EQ(mesh, results[0]);
}

TEST(Groups, ASensorOfSeveralGroupsIsRememberedAlikeOnAnyNumberOfThreads) {
  std::vector<kit::Part> parts = pairs_of_sensors(5);
  for (kit::Part& part : parts) part.sources.push_back(test::source(99, {}));
  std::vector<Mesh> results;
  for (const int threads : {1, 8}) {
    Arena arena(threads);
    arena.run([&] {
      merge::QualityMemory memory;
      for (int frame = 0; frame < 3; ++frame) results.push_back(merged(parts, &memory));
    });
  }
  for (int frame = 0; frame < 3; ++frame) EXPECT_EQ(results[frame], results[frame + 3]) << frame;
}

}  // namespace
}  // namespace mr
