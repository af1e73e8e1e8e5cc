#include "mr/kit/raster.h"

#include <gtest/gtest.h>

#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"
#include "support/meshes.h"

namespace mr {
namespace {

Camera camera() {
  Camera c;
  c.width = 160, c.height = 120, c.fx = 150, c.fy = 140, c.cx = 71, c.cy = 63;
  return c;
}

TEST(Raster, AgreesWithRaysThroughPixelCentres) {
  Mesh mesh = test::sphere({0.2f, -0.1f, 2.5f}, 0.6f, 24);
  append(mesh, test::grid({-3, -3, 4}, {6, 0, 0.5f}, {0, 6, 0.3f}, 4, 4));
  append(mesh,
         test::grid({-0.6f, 0.4f, -1}, {1.2f, 0, 0}, {0, 0, 4}, 1, 1));  // through the near plane
  const kit::Raster raster = kit::rasterize(mesh, camera(), Pose{});
  const Mesh* meshes[] = {&mesh};
  const kit::RayScene rays(meshes);
  int different = 0;
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      const Vec3d d = unproject(camera(), {double(x), double(y)});
      const auto hit = rays.first_hit({0, 0, 0}, vec_cast<float>(d), 0.05f, 100);
      const float depth = *raster.depth.at(x, y);
      if (hit.has_value() != (depth > 0) || (hit && std::abs(hit->distance - depth) > 2e-3f))
        ++different;
    }
  EXPECT_LE(different, 160 * 120 / 500);  // silhouettes may differ by rounding
}

TEST(Raster, SameOnAnyNumberOfThreads) {
  const Mesh mesh = test::sphere({0, 0, 2}, 1, 40);
  std::vector<kit::Raster> results;
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    arena.run([&] { results.push_back(kit::rasterize(mesh, camera(), Pose{})); });
  }
  EXPECT_EQ(results[0].depth, results[1].depth);
  EXPECT_EQ(results[0].triangle, results[2].triangle);
}

TEST(Raster, NearestSurfaceWins) {
  Mesh mesh = test::grid({-1, -1, 3}, {2, 0, 0}, {0, 2, 0}, 1, 1);
  append(mesh, test::grid({-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, 1, 1));
  const kit::Raster raster = kit::rasterize(mesh, camera(), Pose{});
  EXPECT_NEAR(*raster.depth.at(71, 63), 2, 1e-5);
  EXPECT_GE(*raster.triangle.at(71, 63), 2u);
}

TEST(CubeFaces, LookEveryWayOnceWithARingAround) {
  const auto faces = kit::cube_faces(20, 3);
  Camera panorama;
  panorama.model = CameraModel::equirectangular;
  panorama.width = 96, panorama.height = 48;
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 96; ++x) {
      const Vec3d ray = unproject(panorama, {double(x), double(y)});
      int inside = 0;
      for (const kit::CubeFace& face : faces) {
        const auto pixel = project(face.camera, transposed(face.R_camera_face) * ray);
        if (!pixel) continue;
        const double least = face.ring_px - 0.5, most = face.camera.width - 1 - least;
        inside += pixel->x >= least && pixel->y >= least && pixel->x <= most && pixel->y <= most;
      }
      EXPECT_EQ(inside, 1) << x << " " << y;
    }
  for (const kit::CubeFace& face : faces) EXPECT_DOUBLE_EQ(determinant(face.R_camera_face), 1);
}

TEST(CubeFaces, AsDenseAsTheCamera) {
  Camera lidar;
  lidar.model = CameraModel::lidar;
  lidar.width = 628, lidar.height = 3;
  lidar.beam_altitude_rad = {0.1, 0.0, -0.1}, lidar.beam_azimuth_rad = {0, 0, 0};
  EXPECT_NEAR(kit::pixels_per_rad(lidar).x, 99.95, 0.01);
  EXPECT_NEAR(kit::pixels_per_rad(lidar).y, 10, 1e-9);
  EXPECT_EQ(kit::pixels_per_rad(camera()).y, 140);
}

TEST(Camera, AScaledOneSeesTheSameView) {
  Camera whole;
  whole.width = 96, whole.height = 64;
  whole.fx = 60, whole.fy = 62, whole.cx = 47.3, whole.cy = 31.8;
  const Camera half = kit::scaled(whole, 0.5);
  EXPECT_EQ(half.width, 48);
  const auto corner = project(whole, {-0.3, 0.2, 1}), same = project(half, {-0.3, 0.2, 1});
  EXPECT_NEAR(same->x + 0.5, 0.5 * (corner->x + 0.5), 1e-12);
  EXPECT_NEAR(same->y + 0.5, 0.5 * (corner->y + 0.5), 1e-12);
}

}  // namespace
}  // namespace mr
