#include "mr/merge/layers.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "mr/kit/raycast.h"
#include "support/meshes.h"

namespace mr {
namespace {

Camera camera() {
  Camera c;
  c.width = 96, c.height = 64, c.fx = 60, c.fy = 62, c.cx = 47.3, c.cy = 31.8;
  return c;
}

const Pose kEye = look_at({0.1, -0.2, 0}, {0, 0, 2}, {0, -1, 0});

/// Two walls, one behind the other, a slanted floor that passes beneath the camera, and a back.
Mesh scene() {
  Mesh mesh = test::grid({-1, 1, 2}, {2, 0, 0}, {0, -2, 0}, 9, 9, 0.01f, 1);
  append(mesh, test::grid({-2, 2, 3}, {4, 0, 0}, {0, -4, 0}, 7, 7, 0.02f, 2));
  append(mesh, test::grid({-1, 0.5f, -1}, {2, 0, 0}, {0, 0.3f, 4}, 5, 5, 0.01f, 3));
  append(mesh, test::grid({1, 1, 1.5f}, {-2, 0, 0}, {0, -2, 0}, 3, 3));
  return mesh;
}

TEST(Layers, AgreeWithCastRays) {
  const Mesh mesh = scene();
  const Mesh* meshes[] = {&mesh};
  const kit::RayScene rays(meshes);
  const merge::Layers layers = merge::draw_layers(mesh, camera(), kEye);
  std::vector<kit::RayHit> hits;
  int different = 0, met = 0;
  for (int y = 0; y < layers.height; ++y)
    for (int x = 0; x < layers.width; ++x) {
      rays.all_hits(layers.origin, layers.ray(x, y), 0.05f, 100, hits);
      std::erase_if(hits, [&](const kit::RayHit& h) {
        return dot(mesh.area_normal(h.triangle), layers.ray(x, y)) >= 0;
      });
      const auto drawn = layers.at(x, y);
      met += static_cast<int>(hits.size());
      if (drawn.size() != hits.size()) {
        ++different;
        continue;
      }
      for (std::size_t i = 0; i < hits.size(); ++i) {
        if (drawn[i].triangle != hits[i].triangle) {
          ++different;
        } else {
          EXPECT_NEAR(drawn[i].depth_m, hits[i].distance, 1e-3f * hits[i].distance);
        }
      }
    }
  EXPECT_GT(met, 5000);
  EXPECT_LT(different, met / 200);  // corners move by 1/512 pixel at most
}

TEST(Layers, AnEdgeBelongsToOneOfItsTriangles) {
  // Every inner edge and corner of the grid lies on pixel centres.
  Camera c = camera();
  c.fx = c.fy = 64, c.cx = 48, c.cy = 32;
  const Pose eye = look_at({0, 0, 0}, {0, 0, 2}, {0, -1, 0});
  const Mesh wall = test::grid({-0.5f, 0.5f, 2}, {1, 0, 0}, {0, -1, 0}, 4, 4);
  const merge::Layers layers = merge::draw_layers(wall, c, eye);
  int met = 0;
  for (int y = 0; y < c.height; ++y)
    for (int x = 0; x < c.width; ++x) {
      EXPECT_LE(layers.at(x, y).size(), 1u) << x << ' ' << y;
      met += static_cast<int>(layers.at(x, y).size());
    }
  EXPECT_EQ(met, 32 * 32);
}

TEST(Layers, FlaggedTrianglesLimitThePicture) {
  const Mesh mesh = scene();
  std::vector<std::uint8_t> flagged(mesh.triangles.size(), 0);
  for (std::size_t t = 0; t < 40; ++t) flagged[t] = 1;
  const merge::Layers all = merge::draw_layers(mesh, camera(), kEye);
  const merge::Layers some = merge::draw_layers(mesh, camera(), kEye, &flagged);
  for (int y = 0; y < all.height; ++y)
    for (int x = 0; x < all.width; ++x) {
      const auto expected = all.at(x, y), drawn = some.at(x, y);
      const bool wanted = std::any_of(expected.begin(), expected.end(),
                                      [&](const auto& f) { return flagged[f.triangle] != 0; });
      ASSERT_EQ(drawn.size(), wanted ? expected.size() : 0) << x << ' ' << y;
      for (std::size_t i = 0; i < drawn.size(); ++i)
        EXPECT_EQ(drawn[i].triangle, expected[i].triangle);
    }
}

TEST(Layers, ScaledCameraSeesTheSameView) {
  const Camera half = merge::scaled(camera(), 0.5);
  EXPECT_EQ(half.width, 48);
  const auto corner = project(camera(), {-0.3, 0.2, 1}), same = project(half, {-0.3, 0.2, 1});
  EXPECT_NEAR(same->x + 0.5, 0.5 * (corner->x + 0.5), 1e-12);
  EXPECT_NEAR(same->y + 0.5, 0.5 * (corner->y + 0.5), 1e-12);
}

}  // namespace
}  // namespace mr
