#include "mr/kit/raycast.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

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

TEST(NearestPoint, OfATriangleLiesInsideOnASideOrAtACorner) {
  const Vec3d a{0, 0, 0}, b{2, 0, 0}, c{0, 2, 0};
  const auto expect = [&](Vec3d from, Vec3d to) {
    const Vec3d p = nearest_on_triangle(from, a, b, c);
    EXPECT_NEAR(length(p - to), 0, 1e-12) << p.x << ' ' << p.y << ' ' << p.z;
  };
  expect({0.5, 0.5, 3}, {0.5, 0.5, 0});
  expect({0.5, -1, -2}, {0.5, 0, 0});
  expect({-1, 0.75, 1}, {0, 0.75, 0});
  expect({2, 2, 0}, {1, 1, 0});
  expect({-3, -1, 1}, a);
  expect({5, -1, 1}, b);
  expect({-1, 4, 1}, c);
}

TEST(NearestPoint, OfADegenerateTriangleLiesOnWhatIsLeftOfIt) {
  const Vec3d p = nearest_on_triangle({1, 1, 0}, {0, 0, 0}, {3, 0, 0}, {2, 0, 0});
  EXPECT_EQ(p, (Vec3d{1, 0, 0}));
  EXPECT_EQ(nearest_on_triangle({1, 1, 0}, {5, 0, 0}, {5, 0, 0}, {5, 0, 0}), (Vec3d{5, 0, 0}));
}

/// Distance to the nearest point by brute force over all triangles: the nearest of the
/// perpendicular foot, if its barycentric coordinates are inside, and the three sides.
double distance_by_hand(Vec3f from, const Mesh& mesh) {
  const Vec3d p = vec_cast<double>(from);
  double best = 1e30;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3d corner[3] = {vec_cast<double>(mesh.corner(t, 0)),
                             vec_cast<double>(mesh.corner(t, 1)),
                             vec_cast<double>(mesh.corner(t, 2))};
    const Vec3d u = corner[1] - corner[0], v = corner[2] - corner[0], w = p - corner[0];
    const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), d = uu * vv - uv * uv;
    const double s = (vv * dot(w, u) - uv * dot(w, v)) / d;
    const double r = (uu * dot(w, v) - uv * dot(w, u)) / d;
    if (s >= 0 && r >= 0 && s + r <= 1) best = std::min(best, length(w - u * s - v * r));
    for (int e = 0; e < 3; ++e) {
      const Vec3d a = corner[e], side = corner[(e + 1) % 3] - a;
      const double at = std::clamp(dot(p - a, side) / dot(side, side), 0.0, 1.0);
      best = std::min(best, length(p - a - side * at));
    }
  }
  return best;
}

TEST(NearestPoint, AgreesWithLookingAtEveryTriangle) {
  const Mesh rough = test::grid({-1, -1, 1}, {2, 0, 0.3f}, {0, 2, 0}, 40, 40, 0.04f, 5);
  const Mesh ball = test::sphere({0.2f, 0.1f, 2}, 0.4f, 12), nothing;
  const RayScene scene = scene_of({&rough, &nothing, &ball});
  std::mt19937 random(1);
  std::uniform_real_distribution<float> place(-2, 3);
  int of_ball = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3f from{place(random), place(random), place(random)};
    const auto found = scene.nearest(from);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->distance_m,
                std::min(distance_by_hand(from, rough), distance_by_hand(from, ball)), 1e-12);
    EXPECT_NEAR(length(found->point - vec_cast<double>(from)), found->distance_m, 1e-12);
    of_ball += found->mesh == 2;
  }
  EXPECT_GT(of_ball, 30);
  EXPECT_LT(of_ball, 370);
}

TEST(NearestPoint, LooksNoFartherThanItIsAskedTo) {
  const Mesh wall = wall_at(1, 4), nothing;
  const RayScene scene = scene_of({&wall}), hollow = scene_of({&nothing});
  EXPECT_FALSE(scene.nearest({0.1f, 0.2f, 0}, 0.999f));
  EXPECT_TRUE(scene.nearest({0.1f, 0.2f, 0}, 1));
  EXPECT_EQ(scene.nearest({0.1f, 0.2f, 1}, 0)->distance_m, 0);
  EXPECT_FALSE(scene.nearest({0, NAN, 0}));
  EXPECT_FALSE(scene.nearest({0, 0, 0}, NAN));
  EXPECT_FALSE(scene.nearest({0, 0, 0}, -1));
  EXPECT_FALSE(hollow.nearest({0, 0, 0}));
}

TEST(NearestPoint, OfEquallyNearOnesItIsTheFirst) {
  const Mesh wall = wall_at(1, 8);
  const RayScene scene = scene_of({&wall, &wall, &wall});
  for (int i = 0; i <= 8; ++i)
    for (int j = 0; j <= 8; ++j) {
      const auto found = scene.nearest({-1 + 0.25f * i, -1 + 0.25f * j, 0.5f});  // at a vertex
      ASSERT_TRUE(found);
      EXPECT_EQ(found->mesh, 0u);
      const auto vertex = static_cast<std::uint32_t>(j * 9 + i);
      const auto holds = [&](const Triangle& t) {
        return t[0] == vertex || t[1] == vertex || t[2] == vertex;
      };
      const auto first = std::ranges::find_if(wall.triangles, holds) - wall.triangles.begin();
      EXPECT_EQ(found->triangle, static_cast<std::uint32_t>(first));
    }
}

}  // namespace
}  // namespace mr::kit
