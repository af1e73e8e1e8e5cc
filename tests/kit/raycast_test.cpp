#include "mr/kit/raycast.h"

#include <gtest/gtest.h>

#include <cmath>

#include "mr/core/parallel.h"
#include "support/meshes.h"

namespace mr::kit {
namespace {

RayScene scene_of(std::initializer_list<const Mesh*> meshes) {
  return RayScene(std::span(meshes.begin(), meshes.size()));
}

Mesh wall_at(float z, int cells = 1) {
  return test::grid({-1, -1, z}, {2, 0, 0}, {0, 2, 0}, cells, cells);
}

TEST(RayScene, FindsEveryLayerInOrderFromBothSides) {
  const Mesh near = wall_at(1), nothing, far = wall_at(3);
  const RayScene scene = scene_of({&far, &nothing, &near});
  std::vector<RayHit> hits(7);
  for (const float direction : {1.0f, -1.0f}) {
    const Vec3f origin{0.3f, 0.1f, direction > 0 ? 0.0f : 4.0f};
    scene.all_hits(origin, {0, 0, direction}, 0, 10, hits);
    ASSERT_EQ(hits.size(), 2u);
    EXPECT_NEAR(hits[0].distance, 1, 1e-6);
    EXPECT_NEAR(hits[1].distance, 3, 1e-6);
    EXPECT_EQ(hits[0].mesh, direction > 0 ? 2u : 0u);
    EXPECT_EQ(hits[1].mesh, direction > 0 ? 0u : 2u);
  }
}

TEST(RayScene, DistancesCountInLengthsOfTheDirection) {
  const Mesh wall = wall_at(3);
  const RayScene scene = scene_of({&wall});
  const auto hit = scene.first_hit({0.1f, 0.2f, 0}, {0, 0, 2}, 0, 10);
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->distance, 1.5f, 1e-6);
}

TEST(RayScene, NearAndFarLimitTheRay) {
  const Mesh a = wall_at(1), b = wall_at(2), c = wall_at(3);
  const RayScene scene = scene_of({&a, &b, &c});
  std::vector<RayHit> hits;
  scene.all_hits({0.1f, 0.2f, 0}, {0, 0, 1}, 1.5f, 2.5f, hits);
  ASSERT_EQ(hits.size(), 1u);
  EXPECT_EQ(hits[0].mesh, 1u);
  EXPECT_FALSE(scene.first_hit({0.1f, 0.2f, 0}, {0, 0, 1}, 3.5f, 9));
  scene.all_hits({0.1f, 0.2f, 2.1f}, {0, 0, 1}, -0.5f, 0.5f, hits);  // begins behind the origin
  ASSERT_EQ(hits.size(), 1u);
  EXPECT_NEAR(hits[0].distance, -0.1f, 1e-6);
}

TEST(RayScene, NoRaySlipsBetweenTriangles) {
  const Mesh wall = wall_at(1, 16);  // turned, so that nothing is exact
  Mesh turned = wall;
  for (Vec3f& p : turned.positions) p = {p.x * 0.8f - p.y * 0.6f, p.x * 0.6f + p.y * 0.8f, p.z};
  const RayScene scene = scene_of({&turned});
  std::vector<RayHit> hits;
  for (const Triangle& t : turned.triangles)
    for (int e = 0; e < 3; ++e)
      for (int k = 0; k <= 4; ++k) {
        const Vec3f a = turned.positions[t[e]], b = turned.positions[t[(e + 1) % 3]];
        Vec3f p = a + (b - a) * (0.25f * k);
        if (std::abs(0.8f * p.x + 0.6f * p.y) > 0.99f || std::abs(0.8f * p.y - 0.6f * p.x) > 0.99f)
          continue;
        scene.all_hits({0.01f, 0.02f, 0}, p - Vec3f{0.01f, 0.02f, 0}, 0, 2, hits);
        ASSERT_FALSE(hits.empty());
        for (std::size_t i = 1; i < hits.size(); ++i) {
          EXPECT_LE(hits[i - 1].distance, hits[i].distance);
          EXPECT_NE(hits[i - 1].triangle, hits[i].triangle);  // each triangle once
        }
      }
}

TEST(RayScene, TheFirstOfEqualHitsIsTheOneThatComesFirst) {
  const Mesh wall = wall_at(1, 8);
  const RayScene scene = scene_of({&wall, &wall, &wall});
  for (int i = 0; i < 50; ++i) {
    const auto hit = scene.first_hit({-0.9f + 0.031f * i, 0.25f, 0}, {0, 0, 1}, 0, 2);
    ASSERT_TRUE(hit);
    EXPECT_EQ(hit->mesh, 0u);
  }
}

TEST(RayScene, AnswersAgreeOnAnyNumberOfThreads) {
  const Mesh ball = test::grid({-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, 100, 100, 0.05f, 3);
  std::vector<std::vector<RayHit>> answers;
  for (const int threads : {1, 8}) {
    auto& hits = answers.emplace_back(10000);
    Arena(threads).run([&] {
      const RayScene scene = scene_of({&ball, &ball});
      parallel_for(hits.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
          hits[i] = scene
                        .first_hit({0, 0, 0},
                                   {0.008f * (i % 100) - 0.4f, 0.008f * (i / 100) - 0.4f, 1}, 0, 9)
                        .value_or(RayHit{});
      });
    });
  }
  for (std::size_t i = 0; i < answers[0].size(); ++i) {
    EXPECT_EQ(answers[0][i].distance, answers[1][i].distance);
    EXPECT_EQ(answers[0][i].triangle, answers[1][i].triangle);
    EXPECT_EQ(answers[0][i].mesh, answers[1][i].mesh);
  }
}

TEST(RayScene, ImpossibleRaysAndEmptyScenesMeetNothing) {
  const Mesh wall = wall_at(1), nothing;
  const RayScene empty = scene_of({}), hollow = scene_of({&nothing});
  RayScene scene = scene_of({&wall});
  EXPECT_FALSE(empty.first_hit({}, {0, 0, 1}, 0, 9));
  EXPECT_FALSE(hollow.first_hit({}, {0, 0, 1}, 0, 9));
  EXPECT_FALSE(scene.first_hit({}, {0, 0, 0}, 0, 9));
  EXPECT_FALSE(scene.first_hit({}, {0, NAN, 1}, 0, 9));
  EXPECT_FALSE(scene.first_hit({}, {0, 0, 1}, 5, 0));
  const RayScene moved = std::move(scene);
  EXPECT_TRUE(moved.first_hit({0.1f, 0.2f, 0}, {0, 0, 1}, 0, 9));
}

}  // namespace
}  // namespace mr::kit
